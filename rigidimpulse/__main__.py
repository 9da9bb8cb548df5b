"""`python -m rigidimpulse`: the command line."""

from rigidimpulse.cli.cli import main

main(prog_name="rigidimpulse")

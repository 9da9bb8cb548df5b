"""`python -m rigidimpulse`: the command line."""

from rigidimpulse.cli import main

main(prog_name="rigidimpulse")

"""The command that compiles all kernels before the first run."""

from __future__ import annotations

import sys

import click

from rigidimpulse.cli.jobs import CHECK_FAILED


@click.command()
@click.option("--processes", type=click.IntRange(min=1), help="How many compile at a time.  [default: one a core]")
def warmup(processes: int | None) -> None:
    """Compile the kernels that first runs of rigid bodies need, once on this machine; what is compiled already is skipped."""
    from time import perf_counter

    from tqdm import tqdm

    from rigidimpulse.core.errors import SceneError
    from rigidimpulse.core.kernel_cache import is_kept
    from rigidimpulse.engine.warm_up import most_processes
    from rigidimpulse.engine.warm_up_all import compile_parts, missing_parts, seconds_for

    if not is_kept():
        raise SceneError("there is no folder to keep kernels in", "name one that can be written in the variable NUMBA_CACHE_DIR")
    parts, number = missing_parts(), processes or most_processes()
    if not parts:
        click.echo("all kernels are compiled: nothing to do")
        return
    minutes = max(seconds_for(parts, number) / 60.0, 1.0)
    click.echo(f"compiling {len(parts)} parts of the kernels, once on this machine, {number} at a time: about {minutes:.0f} min")
    start = perf_counter()
    # smoothing=0: the time left is that at the mean rate. disable=None: no bar where the output is no terminal.
    with tqdm(
        total=100.0, smoothing=0.0, disable=None, leave=False, bar_format="kernels {percentage:3.0f} % |{bar}| {elapsed}, {remaining} left"
    ) as bar:

        def progress(done: float) -> None:
            bar.update(100.0 * done - bar.n)

        failed = compile_parts(parts, number, progress)
    click.echo(f"compiled {len(parts) - len(failed)} of {len(parts)} parts in {perf_counter() - start:.0f} s")
    for each in failed:
        click.echo(f"not compiled: {each.part}: {each.reason}", err=True)
    if failed:
        click.echo("runs that need these compile them when they start", err=True)
        sys.exit(CHECK_FAILED)

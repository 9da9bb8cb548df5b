"""Random scenes by the thousand against the laws that every run keeps: `python tests/bench/random_scenes.py FIRST LAST [--limit S]`.

Runs the scenes of the seeds FIRST to LAST - 1, twice each with --twice, prints one line for each that breaks a law, raises an error,
is reported by its own status or takes longer than the limit, and a summary. The exit code is 1 if any law is broken.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections import Counter
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "invariants"))

from scene_laws import broken_laws
from scene_plans import Dice, make_plan, make_scene

import rigidimpulse as ri


def verdicts(seed: int, limit: float, twice: bool) -> tuple[list[str], list[str]]:
    """What the run of a seed breaks, and what its status says."""
    plan = make_plan(Dice(seed))
    signal.setitimer(signal.ITIMER_VIRTUAL, limit)
    try:
        run = ri.simulate(make_scene(plan), plan.duration)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        broken = broken_laws(plan, run)
        if twice and run.state_hash() != ri.simulate(make_scene(plan), plan.duration).state_hash():
            broken.append("another run has other bits")
    except TimeoutError:
        return [f"not done after {limit:g} s"], []
    except Exception as error:
        return [f"{type(error).__name__}: {error}"], []
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    return broken, [event.kind for event in run.status.events if event.is_problem]


def stop(_signal, _frame):
    """End a run that takes too long."""
    raise TimeoutError


def main() -> int:
    """Run the seeds; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--limit", type=float, default=20.0, help="s of processor time for a scene")
    parser.add_argument("--twice", action="store_true", help="compare the bits of two runs")
    arguments = parser.parse_args()
    signal.signal(signal.SIGVTALRM, stop)
    counts, failed, start = Counter(), 0, process_time()
    for seed in range(arguments.first, arguments.last):
        broken, said = verdicts(seed, arguments.limit, arguments.twice)
        failed += bool(broken)
        counts.update(said)
        if broken or said:
            print(f"seed {seed}: {'; '.join(broken) or 'laws hold'}; status: {', '.join(said) or 'ok'}", flush=True)
    number = arguments.last - arguments.first
    print(f"{number - failed} of {number} scenes keep all laws, {process_time() - start:.0f} s; reported by runs: {dict(counts)}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())

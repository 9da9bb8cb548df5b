"""Random scenes by the thousand against the laws that every run keeps: `python tests/bench/random_scenes.py FIRST LAST [--limit S]`.

Runs the scenes of the seeds FIRST to LAST - 1, with --twice once more as one of many, prints one line for each that breaks a law, raises
an error, is reported by its own status or takes longer than the limit, and a summary. The exit code is 1 if any law is broken.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "invariants"))

from apart import apart
from scene_laws import broken_laws
from scene_plans import Dice, ScenePlan, make_plan, make_scene

import rigidimpulse as ri


def verdicts(seed: int, twice: bool) -> tuple[list[str], list[str]]:
    """What the run of a seed breaks, and what its status says."""
    plan = make_plan(Dice(seed))
    try:
        run = ri.simulate(make_scene(plan), plan.duration)
        broken = broken_laws(plan, run)
        if twice and run.state_hash() != _hash_of_one_of_many(plan):
            broken.append("another run has other bits")
    except Exception as error:
        return [f"{type(error).__name__}: {error}"], []
    return broken, [event.kind for event in run.status.events if event.is_problem]


def _hash_of_one_of_many(plan: ScenePlan) -> str:
    """The state hash of a run that nobody watches: it takes many steps at once where `simulate` takes one."""
    again = next(iter(ri.simulate_many(make_scene(plan), [{}], plan.duration)))
    if again.error is not None:
        raise again.error
    return again.kept.state_hash


def verdicts_apart(seed: int, limit: int, twice: bool) -> tuple[list[str], list[str]]:
    """The verdicts of a seed, from a process of its own."""
    found = apart(verdicts, seed, twice, seconds=limit)
    return ([found], []) if isinstance(found, str) else found


def main() -> int:
    """Run the seeds; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--limit", type=int, default=20, help="s of processor time for a scene")
    parser.add_argument("--twice", action="store_true", help="compare the bits of two runs")
    arguments = parser.parse_args()
    counts, failed, start = Counter(), 0, perf_counter()
    for seed in range(arguments.first, arguments.last):
        broken, said = verdicts_apart(seed, arguments.limit, arguments.twice)
        failed += bool(broken)
        counts.update(said)
        if broken or said:
            print(f"seed {seed}: {'; '.join(broken) or 'laws hold'}; status: {', '.join(said) or 'ok'}", flush=True)
    number = arguments.last - arguments.first
    print(f"{number - failed} of {number} scenes keep all laws, {perf_counter() - start:.0f} s; reported by runs: {dict(counts)}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())

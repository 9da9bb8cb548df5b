"""Whether the sentences of studies come soon and are true: `python tests/bench/sentences.py [NAME ...] [--budget S]`.

Studies dice, dominoes, a cow, a chain and a pile, prints when the sentence came (s of wall clock and of processor time, and the load of the
machine), what it says, and which of its claims an independent run refutes (`tests/unit/claims.py`). The exit code is 1 if any is refuted.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from time import perf_counter, process_time

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "newcomer"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "unit"))

from claims import wrong_claims
from scenes import CORPUS

from rigidimpulse.studies.glance.glance import glance
from rigidimpulse.studies.glance.known import Glance
from rigidimpulse.studies.job import DEFAULT_FPS, Job, find_job

SCENES = ("dice", "domino_row", "spot", "chain_and_anchor", "pile")


def job_of(name: str) -> Job:
    """A scene of the corpus of newcomers, or of the gallery."""
    if name in CORPUS:
        case = CORPUS[name]
        return Job(name, lambda: case.make()[0].scene, case.duration, DEFAULT_FPS, "standard", None)
    return find_job(name)


def judge(name: str, budget: float) -> list[str]:
    """Study a scene, print what it says and when; return the claims that are wrong."""
    start, cpu, said = perf_counter(), process_time(), []

    def changed(known: Glance) -> None:
        if known.verdict is not None and not said:
            said.append(f"sentence after {perf_counter() - start:.1f} s, {process_time() - cpu:.1f} s of processor time")

    known = glance(job_of(name), budget=budget, changed=changed)
    verdict = known.verdict
    assert verdict is not None
    print(f"{name}: {said[0]}, load {os.getloadavg()[0]:.1f}; all in {perf_counter() - start:.0f} s; {known.duration:.3g} s of motion")
    print("  " + verdict.text().replace("\n", "\n  "), flush=True)
    return wrong_claims(known)


def main() -> int:
    """Judge the named scenes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=SCENES)
    parser.add_argument("--budget", type=float, default=60.0, help="s for a study")
    arguments = parser.parse_args()
    print(f"imports: {process_time():.1f} s of processor time")
    refuted = 0
    for name in arguments.names:
        for line in judge(name, arguments.budget):
            print("  REFUTED: " + line)
            refuted += 1
    return 1 if refuted else 0


if __name__ == "__main__":
    sys.exit(main())

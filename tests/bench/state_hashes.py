"""The state hash of every gallery scene, hard case and of some random scenes: what must stay when code is only moved.

    python tests/bench/state_hashes.py > after.txt                 all of them, one line each: name, hash, processor seconds
    python tests/bench/state_hashes.py --against before.txt        the same, and which differ from a file that was written before
    python tests/bench/state_hashes.py spot pile --seeds 0 20      some
    python tests/bench/state_hashes.py --loop compiled             with the compiled order of events, or with the loop in `python`
    python tests/bench/state_hashes.py --duration 0.2              of the beginning of each, s

On what a hash depends, and on what not, stands in `tests/determinism/test_gallery_hashes.py`.
A scene without a hash (an error, or the limit of time) is counted apart: it is not compared, even where both trees say the same.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import multiprocessing.connection
import resource
import sys
from collections.abc import Iterator
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "invariants"))

from scene_plans import Dice, make_plan, make_scene

from rigidimpulse import gallery
from rigidimpulse.engine.absent import NoCompiledLoop
from rigidimpulse.engine.exact.compiled_loop import CompiledLoop, why_not
from rigidimpulse.engine.simulate import complete, frame_times, prepare

SEED = "seed_"
LENGTH = 16
"""Characters of a hash that are printed."""


def hash_of(name: str, loop: str = "", longest: float = math.inf) -> tuple[str, str, float]:
    """Name, state hash or error, and processor seconds of one scene.

    loop: "compiled" or "python", "" for what a user gets. longest: s of motion.
    """
    start = process_time()
    try:
        if name.startswith(SEED):
            plan = make_plan(Dice(int(name.removeprefix(SEED))))
            scene, duration, fps, accuracy = make_scene(plan), plan.duration, 60.0, "standard"
        else:
            entry = gallery.load(name)
            scene, duration, fps, accuracy = entry.scene(), entry.duration, entry.fps, entry.accuracy
        duration = min(duration, longest)
        run = prepare(scene, frame_times(duration, fps), accuracy)
        if loop:
            uses = loop == "compiled" and not why_not(run.world, run.plan)
            run.compiled = CompiledLoop(run) if uses else NoCompiledLoop()
        result = complete(run, duration).state_hash()[:LENGTH]
    except Exception as error:
        result = type(error).__name__
    return name, result, process_time() - start


def _answer(sender, name: str, limit: int, loop: str, longest: float) -> None:
    """Send the hash of a scene from a process that the system ends after `limit` s of processor time."""
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
    sender.send(hash_of(name, loop, longest))


def hashes(names: list[str], jobs: int, limit: int, loop: str = "", longest: float = math.inf) -> Iterator[tuple[str, str, float]]:
    """The hashes of scenes, each from a process of its own, in the order in which they end."""
    context = multiprocessing.get_context("fork")
    waiting, running = list(names), []
    while waiting or running:
        while waiting and len(running) < jobs:
            receiver, sender = context.Pipe(duplex=False)
            name = waiting.pop(0)
            process = context.Process(target=_answer, args=(sender, name, limit, loop, longest))
            process.start()
            sender.close()
            running.append((name, process, receiver))
        ready = multiprocessing.connection.wait([receiver for _, _, receiver in running])
        for entry in [entry for entry in running if entry[2] in ready]:
            name, process, receiver = entry
            running.remove(entry)
            try:
                yield receiver.recv()
            except EOFError:
                yield name, f"not_done_in_{limit}_s", float(limit)
            process.join()


def is_hash(result: str) -> bool:
    """Whether a result is a hash, and not an error or a limit."""
    return len(result) == LENGTH and set(result) <= set("0123456789abcdef")


def main() -> int:
    """Print the hashes; the exit code is 1 where one differs from the file of before."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="scenes; all if none is named")
    parser.add_argument("--seeds", nargs=2, type=int, metavar=("FIRST", "END"), help="random scenes of these seeds, END not among them")
    parser.add_argument("--against", type=Path, help="a file that was written before")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    parser.add_argument("--limit", type=int, default=300, help="s of processor time that a scene may take")
    parser.add_argument("--loop", choices=("compiled", "python"), default="", help="which of both loops deals with exact contact")
    parser.add_argument("--duration", type=float, default=math.inf, help="s of motion at most")
    options = parser.parse_args()
    names = options.names or ([] if options.seeds else [*gallery.names(), *gallery.hard_names()])
    names = names + [f"{SEED}{seed}" for seed in range(*(options.seeds or (0, 0)))]
    before = {}
    if options.against:
        before = dict(line.split()[:2] for line in options.against.read_text().splitlines())
    differ, without = [], []
    for name, result, seconds in hashes(names, options.jobs, options.limit, options.loop, options.duration):
        changed = name in before and before[name] != result
        print(f"{name:32} {result:16} {seconds:8.2f}{f'  was {before[name]}' if changed else ''}", flush=True)
        differ += [name] if changed else []
        without += [] if is_hash(result) and is_hash(before.get(name, "")) else [name]
    if before:
        compared = len(names) - len(without)
        print(f"{len(differ)} of {len(names)} differ: {', '.join(differ)}", file=sys.stderr)
        print(f"{compared} have a hash in both; not compared: {', '.join(without)}", file=sys.stderr)
    return bool(differ)


if __name__ == "__main__":
    sys.exit(main())

"""Kinds of random cases, and what counts as a fault of each.

    scenes       2 to 8 bodies (`scene_plans`): a broken law (`scene_laws`), an error, another run with other bits, too much time
    life_cycles  joints that break and let go (`life_cycles`): a broken promise, an error, too much time
    gltf         good files with something wrong in them (`broken_files`): another error than a `SceneError`, too much time or memory
    changes      scenes that change in the middle (`late_changes`): other frames before, other bits where none belong, books that are off
    files        files of all kinds that are read, with something wrong in them (`mutated_files`): the same, 2 s and 1 GB at most
    caches       caches of a stopped run with bytes replaced or cut: another error than a `SceneError`, other bits
    forged       checkpoints put together by hand, with right digests: anything but a refusal
    kills        runs that are killed again and again, with a checkpoint after every step: other bits at the end

A case is plain data that `repr` writes, so that a test can hold it.
"""

from __future__ import annotations

import functools
import random
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import kept_runs
import numpy as np
from broken_files import broken
from choices import Recorded, Replayed
from forged_states import put_state
from late_changes import broken_promises_later, make_late_change
from life_cycles import broken_promises, make_life_cycle
from mutated_files import mutated, read_all
from mutated_files import read as read_file
from scene_laws import broken_laws
from scene_plans import make_plan, make_scene

import rigidimpulse as ri
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.io.cache.read import read

GIGABYTE = 2**30
LIFE = 0.75
"""s of a life cycle."""
CACHED = 0.06
"""s of a run whose cache is damaged."""
RUNS = 10
"""Of as many damaged caches one is run from, though what is read of it is what was there: that shows what is written into damage."""
KILLED = 0.3
"""s of a run that is killed."""


@dataclass(frozen=True)
class Kind:
    """A kind of cases.

    Attributes:
        name: of it. draw: the case of a seed. faults: what is wrong with a case, a line each.
        has_choices: whether a case is a list of numbers that `choices.Replayed` takes. seconds: of processor time, at most.
        memory: bytes, at most; None: as many as there are. warm: has kernels compiled that all cases need.

    """

    name: str
    draw: Callable[[int], Any]
    faults: Callable[[Any], list[str]]
    has_choices: bool = False
    seconds: int = 60
    memory: int | None = None
    warm: Callable[[], object] = lambda: None


def _chosen(generator: Callable[[Any], Any]) -> Callable[[int], list[float]]:
    """A function that draws the choices of a seed."""

    def draw(seed: int) -> list[float]:
        source = Recorded(seed)
        generator(source)
        return source.chosen

    return draw


def _faults_of_scene(chosen: list[float]) -> list[str]:
    plan = make_plan(Replayed(chosen))
    try:
        run = ri.simulate(make_scene(plan), plan.duration)
        broken_ones = broken_laws(plan, run)
        if run.state_hash() != ri.simulate(make_scene(plan), plan.duration).state_hash():
            broken_ones.append("another run has other bits")
    except Exception as error:
        return [f"{type(error).__name__}: {error}"]
    # What a run says itself is no fault, as long as energy is kept.
    return [law for law in broken_ones if run.status.ok or not law.startswith("overlap")]


def _faults_of_life_cycle(chosen: list[float]) -> list[str]:
    try:
        return broken_promises(ri.simulate(make_life_cycle(Replayed(chosen)), LIFE))
    except Exception as error:
        return [f"{type(error).__name__}: {error}"]


def _faults_of_change(chosen: list[float]) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        try:
            return broken_promises_later(make_late_change(Replayed(chosen)), Path(folder))
        except Exception as error:
            return [f"{type(error).__name__}: {error}"]


def _faults_of_gltf(content: bytes) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "broken.glb"
        path.write_bytes(content)
        try:
            compile_scene(ri.load_scene(path))
        except ri.SceneError:
            return []
        except Exception as error:
            return [f"{type(error).__name__}: {error}"]
        left = sorted(entry.name for entry in Path(folder).iterdir() if entry != path)
        return [f"files were left behind: {', '.join(left)}"] if left else []


def _stop(now: float) -> None:
    if now >= 0.5 * CACHED:
        raise KeyboardInterrupt


def _run_in(path: Path, **more: Any) -> ri.Recording:
    return ri.simulate(kept_runs.pile(), CACHED, 100.0, cache=ri.Cache(path, every=0.0), **more)


@functools.cache
def _whole() -> tuple[bytes, str, bytes]:
    """The bytes of a cache of a stopped run, the hash of the whole run, and all that is read of the cache."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        _run_in(path, progress=_stop)
        return path.read_bytes(), ri.simulate(kept_runs.pile(), CACHED, 100.0).state_hash(), _all_of(path)


def _all_of(path: Path) -> bytes:
    """All that a run that goes on reads of a cache."""
    header, content = read(path)
    arrays = [header.times, header.offset, header.turn, content.impacts, *content.frames.values(), content.commit]
    told = [header.fingerprint, header.version, header.duration, header.fps, header.names, header.take, content.time, content.complete]
    return repr(told).encode() + (content.state or b"") + b"".join(np.asarray(array).tobytes() for array in arrays)


def _faults_of_cache(seed: int) -> list[str]:
    content, expected, known = _whole()
    numbers = random.Random(seed)
    place, count = numbers.randrange(len(content)), numbers.choice((1, 1, 1, 8, 100, 4096))
    middle = numbers.choice((numbers.randbytes(count), bytes(count), b""))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        path.write_bytes(content[:place] + middle[: len(content) - place] + content[place + count :])
        try:
            ri.load_recording(path)
            if _all_of(path) == known and seed % RUNS:
                return []
            found = _run_in(path).state_hash()
        except ri.SceneError:
            return []
        except Exception as error:
            return [f"{type(error).__name__}: {error}"]
        return [] if found == expected else ["other bits"]


def _faults_of_forged_state(seed: int) -> list[str]:
    content, _, _ = _whole()
    numbers = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        path.write_bytes(content)
        state = bytearray(read(path)[1].state or b"")
        for _ in range(numbers.choice((1, 1, 10))):
            state[numbers.randrange(len(state))] ^= 1 << numbers.randrange(8)
        put_state(path, bytes(state))
        try:
            _run_in(path)
        except ri.SceneError as error:
            return [] if "not written by this user" in str(error) else [f"not known for forged: {error}"]
        except Exception as error:
            return [f"{type(error).__name__}: {error}"]
        return ["the run went on from a forged checkpoint"]


@functools.cache
def _unharmed(name: str) -> str:
    return kept_runs.run(name, KILLED, None).state_hash()


def _faults_of_kills(case: tuple[str, int]) -> list[str]:
    name, seed = case
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, kept_runs.__file__, name, str(KILLED), str(Path(folder) / "run.h5"), str(seed)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            return [done.stderr.strip().splitlines()[-1] if done.stderr else f"exit code {done.returncode}"]
        left = sorted(entry.name for entry in Path(folder).iterdir())
    kills, found = done.stdout.split()
    faults = [] if found == _unharmed(name) else [f"other bits after {kills} kills"]
    return faults + ([] if left == ["run.h5"] else [f"files were left behind: {', '.join(left)}"])


def _warm_scene() -> None:
    """Compile what scenes with and without joints need, once, and not in every process."""
    for seed in range(4):
        _faults_of_life_cycle(_chosen(make_life_cycle)(seed))


KINDS = {
    kind.name: kind
    for kind in (
        Kind("scenes", _chosen(make_plan), _faults_of_scene, has_choices=True, warm=_warm_scene),
        Kind("life_cycles", _chosen(make_life_cycle), _faults_of_life_cycle, has_choices=True, warm=_warm_scene),
        Kind("changes", _chosen(make_late_change), _faults_of_change, has_choices=True, warm=_warm_scene),
        Kind("gltf", broken, _faults_of_gltf, seconds=2, memory=GIGABYTE, warm=read_all),
        Kind("files", mutated, lambda case: read_file(*case), seconds=2, memory=GIGABYTE, warm=read_all),
        Kind("caches", lambda seed: seed, _faults_of_cache, warm=_whole),
        Kind("forged", lambda seed: seed, _faults_of_forged_state, warm=_whole),
        Kind("kills", lambda seed: (random.Random(seed).choice(sorted(kept_runs.SCENES)), seed), _faults_of_kills, seconds=600),
    )
}

"""Ctrl-C ends a run after its step: the recording has the frames until then, and says that it is partial."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import sleep

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.scene.accuracy import Preset
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.many import simulate_many

SCENES = {"dominoes": 0.4, "cloth_on_ball": 0.2, "arm": 0.3, "pool_break": 1.5, "bounce": 3.0}
"""Scenes of contact, of a flexible body, of joints and motors, of the kernel of balls and of one body; how long they run, s."""


def stop_at(time: float) -> Callable[[float], None]:
    """Return a `progress` that stops the run once it is at this time [s]."""

    def look(now: float) -> None:
        if now >= time:
            raise KeyboardInterrupt

    return look


def falling() -> Scene:
    """A box that falls on a floor."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("box", ri.Shape.box((0.2, 0.3, 0.4)), mass=1.0, position=(0.0, 0.0, 1.0), angular_velocity=(1.0, 2.0, 0.0)))
    return scene


@pytest.mark.parametrize("name", SCENES)
def test_recording_has_frames_until_stop(name: str, tmp_path: Path) -> None:
    """Every frame until then is there, with the bits of the run that goes on, and every output says that this is a part."""
    scene, duration = gallery.load(name).scene(), SCENES[name]
    whole = ri.simulate(scene, duration)
    part = ri.simulate(scene, duration, progress=stop_at(0.5 * duration))
    count = len(part.times)
    assert 0.5 * duration - 1.0 / 60.0 <= part.times[-1] < duration
    assert count < len(whole.times)
    for what in ("times", "positions", "orientations"):
        assert np.array_equal(getattr(part, what), getattr(whole, what)[:count])
    # The corrections at the end of a stretch under contact forces reach the frames of that stretch; the last one may be cut.
    assert np.array_equal(part.velocities[: count - 2], whole.velocities[: count - 2])
    assert np.all(part.impacts["time"] <= part.times[-1] + 1.0 / 60.0)
    assert part.status.is_partial
    assert not part.status.ok
    assert "partial" in part.status.message
    assert part.ledger is not None
    assert all(len(rows) == count for rows in (part.ledger.kinetic, *part.ledger.dissipated.values(), *part.reactions.values()))
    assert all(len(track.vertices) == count for track in part.soft_bodies)
    for body in part.names[:3]:
        assert all(len(impulse) == count for impulse in part.impulses(body).values())
    for suffix in (".npz", ".html"):
        part.export(tmp_path / f"part{suffix}")
    assert ri.load_recording(tmp_path / "part.npz").status.is_partial
    assert not whole.status.is_partial


@pytest.fixture
def heard() -> Iterator[None]:
    """Let Python hear Ctrl-C: what starts the tests in the background has it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
def test_signal_in_a_program() -> None:
    """Ctrl-C itself ends the run between two steps, and means what it meant afterwards."""
    before = signal.getsignal(signal.SIGINT)

    def press(now: float) -> None:
        if now >= 0.1:
            signal.raise_signal(signal.SIGINT)

    part = ri.simulate(falling(), 1.0, progress=press)
    assert part.status.is_partial
    assert 0.08 <= part.times[-1] <= 0.15
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.usefixtures("heard")
def test_second_signal_ends_at_once() -> None:
    """The second Ctrl-C is a KeyboardInterrupt wherever the run is."""

    def press(now: float) -> None:
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    assert ri.simulate(falling(), 1.0, progress=press).status.is_partial


@pytest.mark.parametrize(
    ("name", "accuracy"), [*((name, "standard") for name in ("dominoes", "arm", "pool_break")), ("dominoes", "preview"), ("arm", "preview")]
)
def test_cache_goes_on_from_the_stop(name: str, accuracy: Preset, tmp_path: Path) -> None:
    """A run that is stopped has its last step in its cache, and ends with the same bits; what "preview" knows of costs is in it, too."""
    scene, duration, file = gallery.load(name).scene(), SCENES[name], tmp_path / "run.h5"
    part = ri.simulate(scene, duration, accuracy=accuracy, cache=file, progress=stop_at(0.5 * duration))
    stored = ri.load_recording(file)
    assert stored.status.is_partial
    assert len(stored.times) >= len(part.times) - 1
    begun: list[float] = []
    whole = ri.simulate(scene, duration, accuracy=accuracy, cache=file, progress=begun.append)
    assert begun[0] > part.times[-1]
    assert whole.state_hash() == ri.simulate(scene, duration, accuracy=accuracy).state_hash()


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory as Linux has them")
def test_lack_of_memory_is_told(tmp_path: Path) -> None:
    """A run that asks for more than there is ends with a `SceneError`, and a cache that was begun can be read."""
    program = f"""
import resource
from pathlib import Path
import rigidimpulse as ri
from rigidimpulse import gallery
scene, cache = gallery.load("dominoes").scene(), {str(tmp_path / "run.h5")!r}
ri.simulate(scene, 0.1)
def hoard(now):
    kept.append(bytearray(2**28))
kept = []
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 2**30, used + 2**30))
every_step = ri.Cache(cache, every=0.0)
for ask in (lambda: ri.simulate(scene, 1000.0, fps=10000.0), lambda: ri.simulate(scene, 1.0, cache=every_step, progress=hoard)):
    try:
        ask()
    except ri.SceneError as error:
        kept.clear()
        print(error)
print(ri.load_recording(cache).status.is_partial)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    first, second, third = done.stdout.splitlines()
    assert "not enough memory for 10000001 frames of " in first
    assert "not enough memory for 61 frames of " in second
    assert third == "True"


def test_many_runs_stop() -> None:
    """Where many runs are made, Ctrl-C ends all of them: a part of one is no result."""
    def keep(_run: ri.Recording) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(simulate_many(falling(), [{}, {}], 0.1, keep=keep))


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_command_writes_what_there_is(tmp_path: Path) -> None:
    """`rigidimpulse simulate` writes its files after Ctrl-C, says that they are partial, and ends with 130."""
    target = tmp_path / "run.npz"
    program = f"""
import signal
from rigidimpulse.cli.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # test runners may have it ignored
main(["simulate", "dominoes", "--duration", "600", "--output", {str(target)!r}, "--cache", {str(tmp_path / "run.h5")!r}])
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while not (tmp_path / "run.h5").exists():  # It is there when the first step begins.
            assert process.poll() is None
            sleep(0.05)
        sleep(1.0)
        process.send_signal(signal.SIGINT)
        out, told = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "partial" in out
    assert "Ctrl-C" in told
    run = ri.load_recording(target)
    assert run.status.is_partial
    assert 1 <= len(run.times) < 600 * 60

"""Scenes for tests of wedges, as functions that worker processes find by name, and a program that runs a wedge and is killed."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import rigidimpulse as ri


def drop(height: float = 1.0, seed: int = 0) -> ri.Scene:
    """A ball over the floor."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0.01 * seed, 0, height + 0.1), material=ri.Material(restitution=1.0)))
    return scene


def fragile(height: float = 1.0) -> ri.Scene:
    """The same; from 2 m it is not valid, from 3 m its process dies the first time, from 4 m always, at 5 m the function fails."""
    if height == 3.0 and not (marker := Path(os.environ["WEDGE_TEST_FOLDER"]) / "died").exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if height == 4.0:
        os.kill(os.getpid(), signal.SIGKILL)
    if height == 5.0:
        raise RuntimeError("no such height")
    scene = drop(height)
    if height == 2.0:
        scene.add(ri.Body("bad", ri.Shape.sphere(-1.0)))
    return scene


def killed_after(number: int, folder: str) -> None:
    """Run a wedge in this process, and kill it after some takes."""
    def progress(take: object) -> None:
        nonlocal number
        number -= 1
        if number == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    ri.wedge(drop, {"height": [1.0, 2.0, 3.0]}, folder, duration=0.3, workers=ri.Workers(processes=1), progress=progress)


if __name__ == "__main__":
    killed_after(int(sys.argv[1]), sys.argv[2])

"""Scenes for tests of caches, and a program that kills runs of them: python kept_runs.py NAME DURATION CACHE SEED.

The program simulates in processes of its own, kills each with SIGKILL at some moment, until one comes to its end, and prints the hash.
Checkpoints are written after every step, so that about half of the kills hit one that is being written.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time

import numpy as np

import rigidimpulse as ri


def pile() -> ri.Scene:
    """Spinning boxes that fall on each other and on a concave mesh."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    tub = ri.Shape.compound([
        (ri.Shape.box((2.0, 0.1, 0.5)), (0, s * 1.0, 0.25), (1, 0, 0, 0)) for s in (-1, 1)
    ] + [(ri.Shape.box((0.1, 2.0, 0.5)), (s * 1.0, 0, 0.25), (1, 0, 0, 0)) for s in (-1, 1)])  # fmt: skip
    scene.add(ri.Body("tub", tub, motion="static"))
    random_numbers = np.random.default_rng(5)
    for k in range(6):
        place = (0.4 * (k % 3) - 0.4, 0.2 * random_numbers.normal(), 0.4 + 0.3 * k)
        scene.add(ri.Body(
            f"box{k}", ri.Shape.box((0.3, 0.2, 0.25)), position=place, angular_velocity=random_numbers.normal(size=3) * 3,
            material=ri.Material(restitution=0.3, static_friction=0.5, dynamic_friction=0.4),
        ))  # fmt: skip
    return scene


def gas() -> ri.Scene:
    """Balls in a box, all in the event kernel."""
    scene = ri.Scene(gravity=(0, 0, 0))
    elastic = ri.Material(restitution=1.0)
    for k, normal in enumerate(np.vstack([np.eye(3), -np.eye(3)])):
        scene.add(ri.Body(f"wall{k}", ri.Shape.half_space(normal=normal, offset=-1.0), motion="static", material=elastic))
    random_numbers = np.random.default_rng(3)
    for k, place in enumerate(np.stack(np.meshgrid(*[(-0.6, 0.0, 0.6)] * 3), axis=-1).reshape(-1, 3)):
        velocity = random_numbers.normal(size=3) * 3
        scene.add(ri.Body(f"ball{k}", ri.Shape.sphere(0.1), position=place, velocity=velocity, material=elastic))
    return scene


def forces() -> ri.Scene:
    """A pendulum, a ball on a spring and one that is pushed to and fro, over the floor and through a trigger."""
    scene = pile()
    scene.add(ri.Body("bob", ri.Shape.sphere(0.1), position=(3, 0, 2), velocity=(0, 2, 0)))
    scene.add(ri.BallJoint("bob", None, (3, 0, 3)))
    scene.add(ri.Body("hung", ri.Shape.sphere(0.1), position=(-3, 0, 2)))
    scene.add(ri.Spring("hung", None, (-3, 0, 2), (-3, 0, 3), stiffness=200.0, damping=1.0))
    scene.add(ri.HarmonicForce("hung", amplitude=50.0, frequency=2.0, direction=(1, 0, 0)))
    scene.add(ri.ForceField(lambda time, position, velocity: np.sin(3.0 * time)[:, None] - 0.1 * velocity, bodies=["box0"]))
    scene.add(ri.Trigger("gate", ri.Shape.box((0.5, 0.3, 0.5)), position=(3, 0.5, 2)))
    return scene


SCENES = {"pile": pile, "gas": gas, "forces": forces}


def run(name: str, duration: float, cache: str | None) -> ri.Recording:
    """Simulate a scene, with checkpoints after every step."""
    return ri.simulate(SCENES[name](), duration, 100.0, cache=None if cache is None else ri.Cache(cache, every=0.0))


def main(name: str, duration: str, cache: str, seed: str) -> None:
    """See the head of the file."""
    # All kernels are there, so that what is killed is the run: a child that is killed while it compiles begins to compile again.
    run(name, float(duration), None)
    random_numbers = random.Random(int(seed))
    kills = 0
    while True:
        child = os.fork()
        if child == 0:
            run(name, float(duration), cache)
            os._exit(0)
        # Longer from kill to kill, so that the end is reached.
        time.sleep(random_numbers.uniform(0.05, 0.2 + 0.2 * kills))
        if os.waitpid(child, os.WNOHANG)[0] == 0:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            kills += 1
        else:
            break
    finished = run(name, float(duration), cache)
    print(kills, finished.state_hash())


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Scenes: gravity, bodies and effects, as people write them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from numpy.typing import ArrayLike

from rigidimpulse.core.conventions import STANDARD_GRAVITY
from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.providers import provider
from rigidimpulse.scene.body import Body, vector
from rigidimpulse.scene.effect import SceneEffect
from rigidimpulse.scene.mass import BodyMass, masses_of

if TYPE_CHECKING:
    from rigidimpulse.scene.origin import FileOrigin

Thing = TypeVar("Thing", bound=Body | SceneEffect)
"""What a scene takes; `Scene.add` returns the same kind."""


class Scene:
    """Bodies and what acts on them. Plain data: nothing is computed before it is simulated.

    Attributes:
        gravity: (3,) m/s^2, world frame.
        origin: what is kept of the file that the scene was read from; None for one that was not.

    """

    def __init__(self, gravity: ArrayLike = STANDARD_GRAVITY, bodies: Iterable[Body] = ()) -> None:
        """Make a scene with a uniform gravity, and add the given bodies.

        Raises:
            SceneError: two bodies have the same name.

        """
        self.gravity = gravity
        self._bodies: dict[str, Body] = {}
        self._effects: list[SceneEffect] = []
        self.origin: FileOrigin | None = None
        for body in bodies:
            self.add(body)

    def add(self, thing: Thing) -> Thing:
        """Add a body, or an effect (a `SceneEffect`: forces, joints, triggers, soft bodies), and return it.

        Raises:
            SceneError: the name is taken, no text, or a text that files cannot hold; or it is neither.

        """
        if isinstance(thing, Body):
            _check_name(thing.name)
            if thing.name in self._bodies:
                raise SceneError("the scene has a body of this name already", "give it another", f"body {thing.name!r}")
            self._bodies[thing.name] = thing
        elif isinstance(thing, SceneEffect):
            if (name := getattr(thing, "name", None)) is not None and name != "":
                _check_name(name, type(thing).__name__)
            self._effects.append(thing)
        else:
            what = f"the class {thing.__name__}" if isinstance(thing, type) else f"a {type(thing).__name__}"
            raise SceneError(f"{what} cannot be added to a scene", "add a Body, a force or a joint")
        return thing

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies, in the order they were added."""
        return tuple(self._bodies.values())

    @property
    def effects(self) -> tuple[Any, ...]:
        """The effects, in the order they were added."""
        return tuple(self._effects)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the bodies, in the order they were added."""
        return tuple(self._bodies)

    @property
    def report(self) -> tuple[str, ...]:
        """What of the file that the scene was read from is not in it, or not as it is written there; a line each."""
        return () if self.origin is None else self.origin.report

    def export(self, path: str | os.PathLike[str]) -> Path:
        """Write the scene as a .glb or .gltf file with physics (KHR_physics_rigid_bodies), which `load_scene` reads.

        What the format cannot say (most forces, flexible bodies, rolling friction) is left out: each thing is logged as a
        warning and listed in the file.

        Returns:
            The path.

        Raises:
            SceneError: for another suffix, or a scene that is not valid.

        """
        return provider("write scene")(self, Path(path))

    def __getitem__(self, name: str) -> Body:
        """Return the body of a name; a `SceneError` lists the names there are."""
        if name not in self._bodies:
            raise unknown_name("body", name, self._bodies)
        return self._bodies[name]

    def __setitem__(self, name: str, body: Body) -> None:
        """Put a body in the place of the one of its name, which effects then mean: `scene["door"] = replace(scene["door"], mass=20.0)`.

        Raises:
            SceneError: the scene has no body of this name, or the new one is called something else, or is none.

        """
        if not isinstance(body, Body):
            raise SceneError(f"a {type(body).__name__} is put in its place", "give a Body", f"body {self[name].name!r}")
        if self[name].name != body.name:
            raise SceneError(f"a body called {body.name!r} is put in its place", "give one of the same name", f"body {name!r}")
        self._bodies[name] = body

    def __contains__(self, name: object) -> bool:
        """Whether a body has this name."""
        return name in self._bodies

    def __repr__(self) -> str:
        """Return the numbers of bodies and effects."""
        return f"Scene({len(self._bodies)} bodies, {len(self._effects)} effects)"

    def _repr_html_(self) -> str:
        """Return a picture of the start, for a cell of a notebook."""
        return str(provider("cell of scene")(self))


def _check_name(name: object, what: str = "body") -> None:
    """Raise a `SceneError` for a name that is no text, or one that some file could not hold."""
    if not isinstance(name, str) or not name:
        raise SceneError(f"a {what}'s name is {name!r}", "give a text that is not empty")
    if "\0" in name:
        raise SceneError(f"the name {name[:80]!r} has a NUL in it", "leave it out: files end a text there")
    try:
        name.encode()
    except UnicodeEncodeError:
        raise SceneError(f"the name {name[:80]!r} has a lone surrogate in it", "give letters that UTF-8 can write") from None


def validate(scene: Scene) -> list[BodyMass]:
    """Check everything that can be known about a scene before it is compiled; returns the masses of its bodies.

    Raises:
        SceneError: it names the body, the value and the remedy.

    """
    vector(scene.gravity, "gravity", "m/s^2")
    if not scene.bodies and not any(effect.is_body for effect in scene.effects):
        raise SceneError("the scene has no bodies", "add one: scene.add(Body('ball', Shape.sphere(0.5)))")
    for body in scene.bodies:
        body.check()
    return masses_of(scene.bodies)

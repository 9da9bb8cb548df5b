"""The result of a run: frames, impacts, ledger and status; and the files it can be written to."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.files import write_renamed
from rigidimpulse.core.providers import provider
from rigidimpulse.recording.contacts import CONTACT_DTYPE, forces_on
from rigidimpulse.recording.exporters import ExportOptions, ExportTarget, check_export, find_reader
from rigidimpulse.recording.profile import Profile
from rigidimpulse.recording.status import Status

if TYPE_CHECKING:
    from rigidimpulse.dynamics.soft_body.track import FlexibleTrack
    from rigidimpulse.model.plan import Plan
    from rigidimpulse.recording.choice import Choice
    from rigidimpulse.recording.impulses import Impulses
    from rigidimpulse.recording.ledger import Ledger
    from rigidimpulse.scene.accuracy import Accuracy
    from rigidimpulse.scene.scene import Scene


class RunSettings(NamedTuple):
    """Arguments of `simulate`, without the scene."""

    duration: float
    fps: float
    accuracy: Accuracy
    effects: dict[str, bool]


@dataclass(frozen=True, eq=False)
class Recording:
    """Frames of n bodies at f times.

    Attributes:
        times: (f,) s. names: body names, in order of index.
        positions: (f, n, 3) m, body origins. orientations: (f, n, 4) wxyz, body to world.
        velocities: (f, n, 3) m/s, centres of mass. angular_velocities: (f, n, 3) rad/s, world axes.
        centers: (f, n, 3) m, centres of mass.
        impacts: structured array, one row an impulse at a contact point (see recording.events.IMPACT_DTYPE).
        ledger: energy and momentum per frame. status: how the run went. plan: what was simulated and why.
        scene: the scene as it was written; None in a recording loaded from a file without one.
        reactions: (f, 3) N by joint, see `reaction`.
        contacts: structured array, one row a stretch of time over which a lasting contact carries the same force (see
            recording.contacts.CONTACT_DTYPE); stretches that no frame sees are left out. `contacts_at`, `contact_force` by frame.
        by_cause: impulses by body and cause, see `impulses`; None in a loaded recording.
        soft_bodies: frames of flexible bodies, see `soft_body`.
        profile: where the time of the run went, by stage and by kernel; `profile.table()` for people.
        settings: duration, fps, accuracy and chosen effects of the run; None in a loaded recording.
        choice: how the accuracy was chosen, if it was asked for by `Within` or `InTime`.

    """

    times: np.ndarray
    names: list[str]
    positions: np.ndarray
    orientations: np.ndarray
    velocities: np.ndarray
    angular_velocities: np.ndarray
    centers: np.ndarray
    impacts: np.ndarray
    ledger: Ledger | None = None
    status: Status = field(default_factory=lambda: Status(True, "loaded"))
    plan: Plan | None = None
    scene: Scene | None = None
    reactions: dict[str, np.ndarray] = field(default_factory=dict)
    contacts: np.ndarray = field(default_factory=lambda: np.zeros(0, CONTACT_DTYPE))
    by_cause: Impulses | None = None
    soft_bodies: list[FlexibleTrack] = field(default_factory=list)
    profile: Profile | None = None
    settings: RunSettings | None = None
    choice: Choice | None = None

    def __repr__(self) -> str:
        """Return the motion's length, the numbers of frames, bodies and impacts, and how the run went."""
        length = f"{self.times[-1]:g} s" if len(self.times) else "no motion"
        counts = f"{len(self.times)} frames, {len(self.names)} bodies, {len(self.impacts)} impacts"
        return f"Recording({length}, {counts}, {self.status!r})"

    def _repr_html_(self) -> str:
        """Return the player, for a cell of a notebook."""
        return str(provider("cell of recording")(self))

    @cached_property
    def horizon(self) -> dict[str, float]:
        """Time by body until which the run can be trusted, s: it is one of many plausible ones beyond.

        Until then two runs whose settings bracket those of this run (steps larger and smaller by sqrt(2), tolerances by 10), started off by
        rounding, agree with each other: to the bound of the accuracy target, where there is a `Within`, else to a thousandth of the
        body's size. Dynamic bodies only; the last frame's time where they always agree. The two runs are made when this is first asked for.

        Raises:
            SceneError: for a recording that was loaded from a file.

        """
        if self.scene is None or self.settings is None:
            raise SceneError("a loaded recording, or one from a frame on, cannot be run again", "ask a whole run of simulate()")
        return provider("horizon")(self)

    def index(self, name: str) -> int:
        """Index of a body.

        Raises:
            SceneError: for an unknown name, listing the known ones.

        """
        if name not in self.names:
            raise unknown_name("body", name, self.names)
        return self.names.index(name)

    def position(self, name: str) -> np.ndarray:
        """(f, 3) m, the body's own origin."""
        return self.positions[:, self.index(name)]

    def orientation(self, name: str) -> np.ndarray:
        """(f, 4) wxyz, body to world; signs are continuous."""
        from rigidimpulse.core.quaternion import quaternion_continuity

        return quaternion_continuity(self.orientations[:, self.index(name)])

    def velocity(self, name: str) -> np.ndarray:
        """(f, 3) m/s, of the centre of mass."""
        return self.velocities[:, self.index(name)]

    def angular_velocity(self, name: str) -> np.ndarray:
        """(f, 3) rad/s, world axes."""
        return self.angular_velocities[:, self.index(name)]

    def center_of_mass(self, name: str) -> np.ndarray:
        """(f, 3) m."""
        return self.centers[:, self.index(name)]

    def soft_body(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (f, v, 3) m in the world and faces (t, 3) of a flexible body.

        Raises:
            SceneError: for an unknown name, listing the known ones.

        """
        for track in self.soft_bodies:
            if track.name == name:
                return track.vertices, track.faces
        raise unknown_name("flexible body", name, [track.name for track in self.soft_bodies])

    def reaction(self, name: str) -> np.ndarray:
        """(f, 3) N, force of a joint on its body b; impulses at impacts are not in it.

        Raises:
            SceneError: for an unknown name, listing the known ones.

        """
        if name not in self.reactions:
            raise unknown_name("joint", name, self.reactions)
        return self.reactions[name]

    def impulses(self, name: str) -> dict[str, np.ndarray]:
        """Impulse on a body by cause until each frame, (f, 3) N s; together they are its change of momentum.

        Causes: "gravity", "constant forces", each other force by its name, "joint NAME", "contact with NAME" (lasting contact), "impacts
        with NAME", and "corrections", the changes of velocity at the end of sub-steps. Corrections are small,
        except in sub-stepped islands: there they include all contacts.

        Raises:
            SceneError: for an unknown name, listing the known ones; for a recording that was loaded from a file.

        """
        if self.by_cause is None:
            raise SceneError("a loaded recording has no impulses by cause", "ask the run that simulate() returned")
        return self.by_cause.of(name)

    def contacts_at(self, frame: int) -> np.ndarray:
        """Rows of `contacts` that carry load at a frame (an index of `times`, negative ones from the end).

        A row has body_a, body_b (indices), the point (3,) m where the sub-step began, the normal (3,) from a to b, and the force
        (3,) N on b; that on a is the opposite. Impulses at impacts are not in it, moments of rolling friction neither.

        Raises:
            IndexError: there is no such frame.

        """
        if not -len(self.times) <= frame < len(self.times):
            raise IndexError(f"frame {frame} of a run of {len(self.times)} frames")
        time = self.times[frame]
        return self.contacts[(self.contacts["start"] <= time) & (time < self.contacts["end"])]

    def contact_force(self, name: str) -> np.ndarray:
        """(f, 3) N, sum of the forces of lasting contacts on a body, resting ones included; impulses at impacts are not in it.

        Raises:
            SceneError: for an unknown name, listing the known ones.

        """
        return forces_on(self.contacts, self.index(name), self.times)

    def part(self, first: int, last: int | None = None) -> Recording:
        """Frames `first` to `last`, that included, None: the last one, as a recording of its own whose time begins at 0.

        For a pre-roll: `run.part(48).export("x.glb", start_frame=1001)` leaves out the first 48 frames. Impulses by cause, settings and
        horizon are those of whole runs only.

        Raises:
            SceneError: there are no such frames.

        """
        frames = range(len(self.times))[first : None if last is None else last + 1]
        if not 0 <= first < len(self.times) or not frames or (last is not None and last >= len(self.times)):
            raise SceneError(f"frames {first} to {last} of a run of {len(self.times)}", f"give frames from 0 to {len(self.times) - 1}")
        here, begin, end = slice(frames[0], frames[-1] + 1), self.times[frames[0]], self.times[frames[-1]]
        impacts, contacts = self.impacts.copy(), self.contacts.copy()
        for table, names in ((impacts, ("time",)), (contacts, ("start", "end"))):
            for name in names:
                table[name] -= begin
        arrays = ("positions", "orientations", "velocities", "angular_velocities", "centers")
        return replace(
            self, times=self.times[here] - begin, **{name: getattr(self, name)[here] for name in arrays},
            impacts=impacts[(impacts["time"] >= 0.0) & (impacts["time"] <= end - begin)],
            contacts=contacts[(contacts["end"] > 0.0) & (contacts["start"] <= end - begin)],
            ledger=None if self.ledger is None else self.ledger.part(here),
            reactions={name: force[here] for name, force in self.reactions.items()},
            soft_bodies=[replace(track, vertices=track.vertices[here]) for track in self.soft_bodies],
            status=self.status.later(-float(begin)), by_cause=None, settings=None,
        )  # fmt: skip

    def state_hash(self) -> str:
        """SHA-256 of all frames, flexible bodies and impacts: equal if and only if two runs agree in every bit."""
        import hashlib

        digest = hashlib.sha256()
        for array in (self.times, self.positions, self.orientations, self.velocities, self.angular_velocities):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(np.ascontiguousarray(self.impacts).tobytes())
        for track in self.soft_bodies:
            digest.update(np.ascontiguousarray(track.vertices).tobytes())
        return digest.hexdigest()

    def export(
        self, path: str | os.PathLike, *, start_frame: float = 0.0, tolerance: float | None = None, impact_keys: bool = False,
        only_moved: bool = True, samples: int = 1, up_axis: str | None = None, unit: float = 1.0,
    ) -> Path:  # fmt: skip
        """Write the recording; the suffix of the path chooses the format.

        The formats are those that are registered with `rigidimpulse.recording.exporters`: arrays, tables, pages that play the run, and
        animated files of glTF and of USD (extra `usd`). A scene from a glTF or USD file is written as that file with its nodes or prims
        animated, into a file of the same format. Any other scene is written with one node or prim for each body. See
        docs/guide/gltf.md and docs/guide/usd.md.

        Args:
            path: where to.
            start_frame: of animated files: number of the first frame, at the time start_frame / fps.
            tolerance: of animated files, m: leave out keys that no point of a body misses by more; None: a key a frame.
            impact_keys: of animated files: have keys at the impacts between frames of bodies that fly freely before and after.
            only_moved: of animated files: bodies that do not move have no keys.
            samples: of animated files: keys a frame, for motion blur; in between bodies turn evenly and fly on parabolas.
            up_axis: of USD: "y" or "z"; None: that of the scene. (glTF is Y up.)
            unit: of USD: metres in a unit of the file, 0.01 for centimetres. (glTF is in metres.)

        Raises:
            SceneError: for another suffix, for an option that the format does not have, or without a scene where the format needs shapes.

        """
        path = Path(path)
        options = ExportOptions(start_frame, tolerance, impact_keys, only_moved, samples, up_axis, unit)
        exporter = check_export(path, options, self.scene)
        if exporter.needs_shapes is not None:
            self._need_scene(exporter.needs_shapes)
        return write_renamed(path, lambda target: exporter.write(self, ExportTarget(target, path.stem, options)))

    def show(self) -> Any:
        """Open the recording in the browser (meshcat); returns the viewer, which ends with the program.

        Raises:
            SceneError: without a scene.

        """
        self._need_scene("the viewer")
        return provider("show")(self)

    def _need_scene(self, what: str) -> None:
        if self.scene is None:
            raise SceneError(f"{what} needs the shapes of the scene", "simulate the scene, then export or show that run")


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedRecording(Recording):
    """What `simulate` returns: a recording that has all that a run knows.

    Attributes:
        ledger, by_cause, plan, scene, profile: see `Recording`; never None here.

    """

    ledger: Ledger = field(kw_only=True)
    by_cause: Impulses = field(kw_only=True)
    plan: Plan = field(kw_only=True)
    scene: Scene = field(kw_only=True)
    profile: Profile = field(kw_only=True, default_factory=Profile)


def load_recording(path: str | os.PathLike) -> Recording:
    """Read a recording written as .npz, or the cache of a run (.h5, see `simulate`), which may still be written: its frames so far.

    Raises:
        SceneError: the file is missing or no recording.

    """
    return find_reader(path)(Path(path))

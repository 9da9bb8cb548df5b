"""What a page holds: the manifest that names and paints the bodies, and meshcat's messages with everything large.

Manifest (JSON)
    framing   see `camera.Framing`
    bodies    name, folder (group) and key in meshcat's tree, half spaces, number of the geometry that collides (-1: none) and of the
              one that is drawn, where it is another (rendered, else -1), faceted (collides by its faces), surface, pose of the first
              frame, centre of mass in the body's frame
    softBodies  name, key in meshcat's tree, surface, and whether it is thin (cloth), of each flexible body
    numShapes, fade (s an arrow is seen), summary (a line of text), contacts (whether
              there are any), ledger (least range of its plot, J; null: none), warnings (time, kind, bodies, message)
    status    whether the run is ok, and its message; checks: of a gallery scene, see `check_entries`
    cards     see `impact_cards.card_entries`           arrowScale   m an N s
    joints    see `joints.joint_entries`                spins        see `spins.spin_entries`
Messages, each with its kind
    shape     a display geometry at /shapes/k, shared by all bodies of that shape
    times     frame times as a property of /impacts        rows      arrows as a property of /impacts
    marks     impacts along the time line, see `history`, as a property of /impacts
    contacts  rows of lasting contacts, see `history`, as a property of /contacts
    ledger    energies and momentum, see `history`, as a property of /ledger; and angular momentum, see `spins`
    cards     the tables of `impact_cards`, as properties of /cards
    spins     angular velocities, see `spins`, as a property of /spins
    motion    the animation of all bodies that move; in large recordings instead
    glb       the glTF file that `Recording.export` writes, as a property of /motion
    soft body, frames  faces of a flexible body, and its vertices in all frames, at /softBodies/k
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from rigidimpulse.core.colors import linear_of
from rigidimpulse.recording.exporters import ExportOptions, ExportTarget
from rigidimpulse.scene.origin import bodies_as_seen
from rigidimpulse.scene.shape import rotation_matrix
from rigidimpulse.view.arrows import arrow_rows, arrow_scale, fade_time, longest_arrow
from rigidimpulse.view.camera import Framing, Path, frame_action, up_axis
from rigidimpulse.view.display import SEGMENTS, DisplayMesh, display_mesh, display_planes
from rigidimpulse.view.history import contact_rows, energy_span, impact_marks, ledger_curves
from rigidimpulse.view.impact_cards import card_entries, card_keys, card_rows, card_table
from rigidimpulse.view.joints import fixed_anchors, joint_entries
from rigidimpulse.view.materials import ROUND_KINDS, soft_body_surface, surface
from rigidimpulse.view.protocol import RecordingLike, SoftBodyLike
from rigidimpulse.view.soft_bodies import is_closed, soft_body_messages
from rigidimpulse.view.spins import angular_momentum, spin_entries, spin_rows, spinning
from rigidimpulse.view.tracks import animation_message, body_tracks, pack_bytes, pack_float32, quaternion_keys

MANY_SHAPES = 50
"""Number of different shapes from which round ones are drawn with `FEW_SEGMENTS` at most."""
FEW_SEGMENTS = 24
COARSER = (SEGMENTS, 48, 32, FEW_SEGMENTS, 20, 16)
"""Corners of a full turn of round shapes, from which the finest is taken that `MOST_TRIANGLES` allows."""
MOST_TRIANGLES = 250_000
"""Triangles of all round bodies, of which each has about the square of its corners: machines without a graphics card draw a million a s."""
MOST_KEYS = 200_000
"""Bodies that move times frames, beyond which the motion is a glTF file: a page of 1,000 bodies then opens a second sooner."""
LEVEL = 0.99
"""Least cosine of the slope of a half space that is drawn as the ground and not as an upright plane or a ramp."""
ROUND_OFF = 1e-9
"""m and relative, of a centre of mass."""
SOFT_BODY_COLOUR = 2
"""Colours of the palette that are left out between rigid and flexible bodies: amber blanches on level cloth."""
SOFT_BODY_MARGIN = 0.03
"""Margin about the vertices of a flexible body in the picture, relative to its extent."""


def page_contents(
    recording: RecordingLike, other: RecordingLike | None = None, large: bool = False
) -> tuple[dict[str, Any], list[tuple[str, dict[str, Any]]]]:
    """Return the manifest of a recording's page and its messages, each with its kind.

    Args:
        recording: the motion.
        other: another motion of the same bodies, which the picture must hold as well.
        large: have the motion as a glTF file.

    Raises:
        ValueError: the recording has no frames, or a pose is not finite.

    """
    times = np.asarray(recording.times, dtype=np.float64)
    if len(times) == 0:
        raise ValueError("the recording has no frames; simulate at least one")
    bodies = bodies_as_seen(recording.scene)
    poses = [finite_poses(recording, body.name) for body in bodies]
    numbers, meshes, segments = _shared_meshes(bodies)
    rendered, meshes = _with_rendered(bodies, meshes, segments)
    up = up_axis(recording.scene.gravity)
    soft_bodies = list(recording.soft_bodies)
    framed = poses if other is None else [_both(pose, finite_poses(other, body.name)) for body, pose in zip(bodies, poses, strict=True)]
    runs = [run for run in (recording, other) if run is not None]
    soft_body_paths = [_soft_body_path(*tracks) for tracks in zip(*(run.soft_bodies for run in runs), strict=True)]
    framing = frame_action(_paths(bodies, framed, numbers, meshes) + soft_body_paths + _anchor_paths(fixed_anchors(recording)), up)
    framing = replace(framing, movers=[name for name in framing.movers if name not in {track.name for track in soft_bodies}])
    entries = _entries(recording, bodies, poses, (numbers, rendered), meshes)
    num_coloured = sum(body.motion != "static" for body in bodies)
    radius = float(np.linalg.norm(framing.half))
    dynamic = [body.motion == "dynamic" for body in bodies]
    longest = longest_arrow(radius, framing.body_radius)
    with_card, spins = card_rows(recording.impacts), spinning(recording)
    rows = arrow_rows(recording.impacts, dynamic, longest, with_card)
    contacts = contact_rows(recording.contacts, times, dynamic, up, longest)
    curves = ledger_curves(recording.ledger)
    manifest = {
        "framing": asdict(framing),
        "bodies": entries,
        "softBodies": [
            _soft_body_entry(track, len(bodies) + k, num_coloured + SOFT_BODY_COLOUR + k) for k, track in enumerate(soft_bodies)
        ],
        "numShapes": len(meshes),
        "fade": fade_time(float(times[-1] - times[0])),
        "summary": _summary(sum(dynamic) + len(soft_bodies), len(recording.impacts), float(times[-1] - times[0])),
        "ledger": None if curves is None else {"energySpan": energy_span(recording.ledger)},
        "contacts": len(contacts) > 0,
        "warnings": warning_entries(recording),
        "status": {"ok": recording.status.ok, "message": recording.status.message},
        "checks": [],
        "cards": card_entries(recording, with_card),
        "arrowScale": arrow_scale(recording.impacts, longest),
        "joints": joint_entries(recording),
        "spins": spin_entries(recording, spins),
    }
    messages = [("shape", _shape_message(number, mesh)) for number, mesh in enumerate(meshes)]
    for kind, path, name, values in (
        ("times", "impacts", "times", times),
        ("rows", "impacts", "rows", rows),
        ("marks", "impacts", "marks", impact_marks(recording.impacts, times[0], times[-1])),
        ("contacts", "contacts", "rows", contacts if len(contacts) else None),
        ("ledger", "ledger", "curves", curves),
        ("ledger", "ledger", "angular", angular_momentum(recording) if curves is not None else None),
        ("cards", "cards", "keys", card_keys(recording, with_card).tobytes() if len(with_card) else None),
        ("cards", "cards", "rows", card_table(recording, with_card) if len(with_card) else None),
        ("spins", "spins", "rows", spin_rows(recording, spins) if spins else None),
    ):
        if values is not None:
            messages.append((kind, property_message(path, name, values)))
    for number, track in enumerate(soft_bodies):
        messages += soft_body_messages(track, number)
    return manifest, messages + _motion(recording, entries, poses, large)


def _entries(
    recording: RecordingLike, bodies: list[Any], poses: list[tuple[np.ndarray, np.ndarray]], places: tuple[list[int], list[int]],
    meshes: list[DisplayMesh],
) -> list[dict[str, Any]]:  # fmt: skip
    """Return what the manifest says of bodies as they are seen; places: of the meshes that collide and of those that are drawn."""
    up, (numbers, rendered) = up_axis(recording.scene.gravity), places
    entries, num_coloured = [], 0
    for index, body in enumerate(bodies):
        position, orientation = poses[index]
        seen = rendered[index] if rendered[index] >= 0 else numbers[index]
        planes = [] if rendered[index] >= 0 else _plane_entries(body, orientation[0], up)
        group, key = "ground" if planes and numbers[index] < 0 else "bodies", _path_key(index, body.name)
        entry = {"name": body.name, "group": group, "key": key, "planes": planes, "shape": numbers[index]}
        entry |= {"rendered": rendered[index], "faceted": all(part.shape.kind not in ROUND_KINDS for part in body.shape.parts_flat())}
        entry["surface"] = surface(num_coloured, body, meshes[seen] if seen >= 0 else None)
        num_coloured += body.motion != "static"
        entry["position"] = position[0].tolist()
        entry["quaternion"] = quaternion_keys(orientation[:1])[0].tolist()
        entry["center"] = _center(position[0], orientation[0], recording.center_of_mass(body.name)[0])
        entries.append(entry)
    return entries


def is_large(recording: RecordingLike, most_keys: int = MOST_KEYS) -> bool:
    """Return whether a recording has more keys than that: bodies that move, times frames."""
    names = [body.name for body in recording.scene.bodies if body.motion != "static"]
    if len(names) * len(recording.times) <= most_keys:
        return False
    poses = [(recording.position(name), recording.orientation(name)) for name in names]
    return sum(any(np.any(part != part[0]) for part in pose) for pose in poses) * len(recording.times) > most_keys


def _motion(
    recording: RecordingLike, entries: list[dict[str, Any]], poses: list[tuple[np.ndarray, np.ndarray]], large: bool
) -> list[tuple[str, dict[str, Any]]]:
    """Return the message that brings the motion, if there is any."""
    times = np.asarray(recording.times, dtype=np.float64)
    if large:
        return [("glb", property_message("motion", "file", glb_file(recording)))]
    tracks = {}
    for entry, pose in zip(entries, poses, strict=True):
        tracks[f"{entry['group']}/{entry['key']}"] = body_tracks(times, *pose)
    moving = {path: body_keys for path, body_keys in tracks.items() if body_keys}
    return [("motion", animation_message(moving, float(times[-1])))] if moving else []


def glb_file(recording: Any) -> bytes:
    """Return the .glb file of a recording, a node a body whatever file its scene came from.

    Raises:
        SceneError: a pose is not finite.

    """
    from dataclasses import replace
    from pathlib import Path as FilePath
    from tempfile import TemporaryDirectory

    from rigidimpulse.io.gltf.animate import write_gltf
    from rigidimpulse.scene.scene import Scene

    plain = replace(recording, scene=Scene(recording.scene.gravity, recording.scene.bodies), soft_bodies=[])
    with TemporaryDirectory() as folder:
        path = FilePath(folder) / "motion.glb"
        write_gltf(plain, ExportTarget(path, path.stem, ExportOptions()))
        return path.read_bytes()


def page_scene(
    recording: RecordingLike, anchors: Iterable[tuple[str, np.ndarray]] = ()
) -> tuple[Framing, list[tuple[Any, DisplayMesh | None, dict[str, Any], list[dict[str, Any]]]]]:
    """Return the framing of a recording, and of each body itself, the mesh that is drawn of it, how it is painted and its half spaces.

    Args:
        recording: the motion.
        anchors: names and places (1, 3) m that the picture must hold as well.

    Raises:
        ValueError: the recording has no frames, or a pose is not finite.

    """
    if len(recording.times) == 0:
        raise ValueError("the recording has no frames; simulate at least one")
    bodies = bodies_as_seen(recording.scene)
    poses = [finite_poses(recording, body.name) for body in bodies]
    numbers, meshes, segments = _shared_meshes(bodies)
    rendered, meshes = _with_rendered(bodies, meshes, segments)
    paths = _paths(bodies, poses, numbers, meshes) + [_soft_body_path(track) for track in recording.soft_bodies]
    paths += _anchor_paths(anchors)
    framing, drawn = frame_action(paths, up_axis(recording.scene.gravity)), []
    for entry, body in zip(_entries(recording, bodies, poses, (numbers, rendered), meshes), bodies, strict=True):
        number = entry["rendered"] if entry["rendered"] >= 0 else entry["shape"]
        drawn.append((body, meshes[number] if number >= 0 else None, entry["surface"], entry["planes"]))
    return framing, drawn


def _both(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions (2 f, 3) and orientations (2 f, 4) of a body in two runs, one after the other."""
    return np.concatenate([a[0], b[0]]), np.concatenate([a[1], b[1]])


def finite_poses(recording: RecordingLike, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (f, 3) and orientations (f, 4) of a body; raise ValueError if one is not finite."""
    position = np.asarray(recording.position(name), dtype=np.float64)
    orientation = np.asarray(recording.orientation(name), dtype=np.float64)
    finite = np.isfinite(position).all(axis=1) & np.isfinite(orientation).all(axis=1)
    if not finite.all():
        frame = int(np.argmin(finite))
        raise ValueError(f"body {name!r}: the pose of frame {frame} is not finite; look at the status of the run")
    return position, orientation


def _shared_meshes(bodies: list[Any]) -> tuple[list[int], list[DisplayMesh], int]:
    """Return for each body the number of its display mesh, -1 for none, the meshes, and the corners of a full turn of round ones.

    Equal shapes share one mesh.
    """
    different: dict[Any, Any] = {}
    keys = [body.shape.drawn_key for body in bodies]
    for key, body in zip(keys, bodies, strict=True):
        different.setdefault(key, body.shape)
    num_round = sum(part.shape.kind in ROUND_KINDS for body in bodies for part in body.shape.parts_flat())
    finest = SEGMENTS if len(different) < MANY_SHAPES else FEW_SEGMENTS
    allowed = [corners for corners in COARSER if corners <= finest and num_round * corners**2 <= MOST_TRIANGLES]
    segments = allowed[0] if allowed else COARSER[-1]
    number_of: dict[Any, int] = {}
    meshes = []
    for key, shape in different.items():
        mesh = display_mesh(shape, segments)
        number_of[key] = -1 if mesh is None else len(meshes)
        if mesh is not None:
            meshes.append(mesh)
    return [number_of[key] for key in keys], meshes, segments


def _with_rendered(bodies: list[Any], meshes: list[DisplayMesh], segments: int) -> tuple[list[int], list[DisplayMesh]]:
    """Return for each body the number of the mesh that is drawn where it is not the one that collides, else -1, and all meshes.

    Args:
        bodies: as they are seen. meshes: those that collide. segments: corners of a full turn of round shapes.

    """
    place: dict[bytes, int] = {}
    rendered, known = [], list(meshes)
    for body in bodies:
        key = None if body.drawn_shape is body.shape else body.drawn_shape.drawn_key
        if key is not None and key not in place:
            mesh = display_mesh(body.drawn_shape, segments)
            assert mesh is not None, "a visual has a surface"
            place[key] = len(known)
            known.append(mesh)
        rendered.append(-1 if key is None else place[key])
    return rendered, known


def _center(position: np.ndarray, orientation: np.ndarray, center: np.ndarray) -> list[float]:
    """Return the centre of mass (3,) m in the frame of a body; exactly zero where it is the body's origin up to round-off."""
    offset = rotation_matrix(orientation).T @ (center - position)
    return np.where(np.abs(offset) > ROUND_OFF * (1.0 + np.abs(center).max()), offset, 0.0).tolist()


def _paths(
    bodies: list[Any], poses: list[tuple[np.ndarray, np.ndarray]], numbers: list[int], meshes: list[DisplayMesh]
) -> list[Path]:
    """Return the paths of all bodies that are not just half spaces."""
    radii = [float(np.sqrt(np.max(np.sum(mesh.vertices**2, axis=1)))) for mesh in meshes]
    paths = []
    for body, (position, orientation), number in zip(bodies, poses, numbers, strict=True):
        if number >= 0:
            moves = body.motion != "static" and bool(
                np.any(position != position[0]) or np.any(orientation != orientation[0])
            )
            surface = None if moves else position[0] + meshes[number].vertices @ rotation_matrix(orientation[0]).T
            paths.append(Path(body.name, position, radii[number], moves, surface))
    return paths


def _anchor_paths(anchors: Iterable[tuple[str, np.ndarray]]) -> list[Path]:
    """Return places of anchors, which stand, as paths."""
    return [Path(name, place, 0.0, moves=False, surface=place) for name, place in anchors]


def _soft_body_path(*tracks: SoftBodyLike) -> Path:
    """Return the places of all vertices of a flexible body in all frames of its tracks, as a path."""
    vertices = np.concatenate([np.asarray(track.vertices, dtype=np.float64) for track in tracks])
    margin = SOFT_BODY_MARGIN * float(np.linalg.norm(np.ptp(vertices[0], axis=0)))
    return Path(tracks[0].name, vertices.reshape(-1, 3), margin, moves=True)


def _soft_body_entry(track: SoftBodyLike, index: int, colour: int) -> dict[str, Any]:
    """Return what the manifest says of a flexible body."""
    closed = is_closed(track.faces)
    surface = soft_body_surface(colour, closed)
    return {"name": track.name, "key": _path_key(index, track.name), "surface": surface, "thin": not closed}


def _plane_entries(body: Any, orientation: np.ndarray, up: np.ndarray) -> list[dict[str, Any]]:
    """Return the half spaces of a body for the manifest: normal, offset, whether it is level ground, and the colour, if it has one."""
    entries = []
    for normal, offset in display_planes(body.shape):
        level = bool(up @ rotation_matrix(orientation) @ normal > LEVEL)
        chosen = None if body.visual is None else body.visual.hex_color()
        entries.append({"normal": normal.tolist(), "offset": offset, "level": level, "color": chosen})
    return entries


def _path_key(index: int, name: str) -> str:
    """Return the body's name in meshcat's tree: unique, and without the slash that parts folders."""
    return f"{index} {name.replace('/', chr(0x2215))}"


def warning_entries(recording: RecordingLike) -> list[dict[str, Any]]:
    """Return what the page says of each problem of a run; a status without events has lines only."""
    status = recording.status
    if status.ok:
        return []
    if not status.problems:
        return [{"time": None, "kind": warning, "bodies": "", "message": ""} for warning in status.warnings]
    return [{"time": e.time, "kind": e.kind, "bodies": ", ".join(e.bodies), "message": e.message} for e in status.problems]


def check_entries(checks: Iterable[Any]) -> list[dict[str, Any]]:
    """Return what the page says of checks, each with what, value, bound, passed, law and relation."""
    names = ("what", "law", "relation", "passed")
    return [
        {name: getattr(check, name) for name in names} | {key: _number(getattr(check, key)) for key in ("value", "bound")}
        for check in checks
    ]


def _number(value: float) -> str:
    """Return a value of a check as people read it: counts in full, quantities with three digits."""
    return f"{int(value):,}" if float(value).is_integer() and abs(value) < 1e15 else f"{value:.3g}"


def _summary(num_dynamic: int, num_impacts: int, duration: float) -> str:
    """Return the line below the title."""
    bodies = f"{num_dynamic} moving {'body' if num_dynamic == 1 else 'bodies'}"
    impacts = f"{num_impacts:,} {'impact' if num_impacts == 1 else 'impacts'}"
    return f"{bodies}  \u00b7  {impacts}  \u00b7  {duration:.4g} s"


def _shape_message(number: int, mesh: DisplayMesh) -> dict[str, Any]:
    """Return meshcat's `set_object` message of a display geometry.

    meshcat's own `TriangularMeshGeometry` has no normals, and draws its identifiers from the clock.
    """
    from meshcat.geometry import pack_numpy_array

    geometry, material = f"geometry {number}", f"material {number}"
    attributes = {"position": mesh.vertices, "normal": mesh.normals}
    if mesh.colors is not None:
        attributes["color"] = linear_of(mesh.colors / 255.0)  # three.js takes those of vertices as light
    return {
        "type": "set_object",
        "path": f"/shapes/{number}",
        "object": {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{
                "uuid": geometry,
                "type": "BufferGeometry",
                "data": {
                    "attributes": {
                        name: pack_numpy_array(values.T.astype(np.float32)) for name, values in attributes.items()
                    },
                    "index": pack_numpy_array(mesh.faces.T.astype(np.uint32)),
                },
            }],
            "materials": [{"uuid": material, "type": "MeshBasicMaterial"}],
            "object": {"uuid": f"mesh {number}", "type": "Mesh", "geometry": geometry, "material": material},
        },
    }  # fmt: skip


def property_message(path: str, name: str, values: np.ndarray | bytes) -> dict[str, Any]:
    """Return meshcat's `set_property` message that hangs a Float32Array, or bytes as a Uint8Array, on a node."""
    packed = pack_bytes(values) if isinstance(values, bytes) else pack_float32(values)
    return {"type": "set_property", "path": "/" + path, "property": name, "value": packed}

"""The page of two runs: that of the first one, with the second as ghosts in it and a plot of how far they are apart.

To the manifest and the messages of `contents` are added
    comparison   in the manifest: labels of the runs; ghosts: name, key in meshcat's tree, shape, paint and pose of the first frame of each
                 body that is not static; softBodies: name and key of each flexible body; horizon (s) by name
    motion       also animates /ghosts/key
    apart        distance (m) and angle (rad) by body, ghosts first, then flexible bodies, and frame, as properties of /ghosts
    frames       vertices of a flexible body in all frames of the second run, as a property of /ghosts/key
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rigidimpulse.view.contents import finite_poses, page_contents, property_message, warning_entries
from rigidimpulse.view.page import SCRIPTS, STYLES, assemble
from rigidimpulse.view.tracks import TypedTrack, animation_message, body_tracks, quaternion_keys

if TYPE_CHECKING:
    from rigidimpulse.studies.compare import Comparison

COMPARISON_SCRIPTS = (*SCRIPTS, "ghosts.js", "distance_plot.js", "compare.js")
COMPARISON_STYLES = (*STYLES, "compare.css")


def render_comparison(comparison: Comparison) -> str:
    """Return the HTML page of a comparison.

    Raises:
        ValueError: the runs have no frames, or a pose is not finite.

    """
    manifest, messages = comparison_contents(comparison)
    return assemble(manifest, messages, " and ".join(comparison.labels), COMPARISON_SCRIPTS, COMPARISON_STYLES)


def comparison_contents(comparison: Comparison) -> tuple[dict[str, Any], list[tuple[str, dict[str, Any]]]]:
    """Return the manifest of a comparison's page and its messages, each with its kind.

    Raises:
        ValueError: the runs have no frames, or a pose is not finite.

    """
    run = comparison.run_b
    times = np.asarray(run.times, dtype=np.float64)
    manifest, messages = page_contents(comparison.run_a, run)
    drawn = {entry["name"]: entry for entry in manifest["bodies"] + manifest["softBodies"]}
    soft_body_names = [track.name for track in run.soft_bodies]
    ghosts, tracks = [], {}
    for name in comparison.names:
        if name not in soft_body_names:
            position, orientation = finite_poses(run, name)
            ghosts.append(_ghost_entry(drawn[name], position[0], orientation[:1]))
            tracks[f"ghosts/{drawn[name]['key']}"] = body_tracks(times, position, orientation)
    manifest["comparison"] = {
        "labels": list(comparison.labels),
        "ghosts": ghosts,
        "softBodies": [{"name": name, "key": drawn[name]["key"]} for name in soft_body_names],
        "horizon": {name: max(time, float(times[0]) - 1.0) for name, time in comparison.horizon.items() if time < np.inf},
    }
    manifest["summary"] = _summary(comparison)
    manifest["warnings"] = [
        entry | {"kind": f"{label}: {entry['kind']}"}
        for label, one in zip(comparison.labels, (comparison.run_a, run), strict=True) for entry in warning_entries(one)
    ]  # fmt: skip
    manifest["ledger"] = None  # the plot of the two runs is in its place
    messages = [entry for entry in messages if entry[0] != "ledger"]
    for values in ("distance", "angle"):
        by_body = [getattr(comparison, values)(name) for name in comparison.names]
        messages.append(("apart", property_message("ghosts", values, np.array(by_body))))
    for track in run.soft_bodies:
        if not np.isfinite(track.vertices).all():
            raise ValueError(f"flexible body {track.name!r}: a vertex is not finite; look at the status of the run")
        messages.append(("frames", property_message(f"ghosts/{drawn[track.name]['key']}", "frames", track.vertices)))
    return manifest, _with_motion(messages, {path: keys for path, keys in tracks.items() if keys}, float(times[-1]))


def _ghost_entry(entry: dict[str, Any], position: np.ndarray, orientation: np.ndarray) -> dict[str, Any]:
    """Return what the manifest says of a ghost: the entry of its body, at the pose it has in the first frame of the second run."""
    pose = {"position": position.tolist(), "quaternion": quaternion_keys(orientation)[0].tolist()}
    return {"name": entry["name"], "key": entry["key"], "shape": entry["shape"], "octants": entry["surface"]["octants"], **pose}


def _with_motion(
    messages: list[tuple[str, dict[str, Any]]], tracks: dict[str, list[TypedTrack]], duration: float
) -> list[tuple[str, dict[str, Any]]]:
    """Return the messages with these tracks in their motion: meshcat's animator holds one animation only."""
    if not tracks:
        return messages
    motion = animation_message(tracks, duration)
    for kind, message in messages:
        if kind == "motion":
            motion = {**message, "animations": message["animations"] + motion["animations"]}
    return [entry for entry in messages if entry[0] != "motion"] + [("motion", motion)]


def _summary(comparison: Comparison) -> str:
    """Return the line below the title."""
    number, times = len(comparison.names), comparison.run_a.times
    impacts = " and ".join(f"{len(run.impacts):,}" for run in (comparison.run_a, comparison.run_b))
    bodies = f"{number} moving {'body' if number == 1 else 'bodies'}"
    return f"{bodies}  \u00b7  {impacts} impacts  \u00b7  {float(times[-1] - times[0]):.4g} s"

"""206 recorded queries of two features on curved paths (data/ccd): every contact found in time, and none that is not there.

The times of contact were computed independently, to about 1e-9 of the interval. Their own rounding limits the agreement: a gap that is
good to 4e-16 m (coordinates of 2 m) and closes at c gives a time good to 4e-16 / c; in the slowest contact c is 2e-6 m per interval, hence
2e-10 of it. Some features turn by 409,327 rad in the interval and touch after 8.6e-12 of it: there the error is relative to that time.
"""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from rigidimpulse.collision.time_of_impact.feature_paths import FeaturePath, first_contact

DATA = Path(__file__).parents[1] / "data" / "ccd"


def feature(record):
    """Corners and path of one feature of a query."""
    names = [name for name in ("vertex", "vertex0", "vertex1", "vertex2") if name in record]
    poses = record["pose_t0"], record["pose_t1"]
    path = FeaturePath(np.array([p["position"] for p in poses]), np.array([p["rotation"] for p in poses]))
    return np.array([record[name] for name in names]), path


def queries():
    """Features a and b and the time of contact (None: none) of every query."""
    rows = csv.DictReader((DATA / "truth.csv").read_text().splitlines())
    truth = {row["file"]: row["toi"] for row in rows}
    for query in json.loads((DATA / "queries.json").read_text()):
        a, b = (query["edge0"], query["edge1"]) if query["type"] == "ee" else (query["face"], query["vertex"])
        time = truth[query["name"]]
        yield (*feature(a), *feature(b), float(time) if time else None)


def test_all_queries():
    answers = [(time, first_contact(a, path_a, b, path_b)) for a, path_a, b, path_b, time in queries()]
    assert len(answers) == 206
    hits = [(time, found) for time, found in answers if time is not None]
    assert len(hits) == 6
    assert all(found == np.inf for time, found in answers if time is None)
    for time, found in hits:
        assert abs(found - time) < 1e-9
        assert abs(found - time) < 2e-9 * time


def test_order_of_features_does_not_matter():
    for a, path_a, b, path_b, _ in list(queries())[:20]:
        one, other = first_contact(a, path_a, b, path_b), first_contact(b, path_b, a, path_a)
        assert one == other or abs(one - other) < 2e-9 * one


def test_spinning_edge_and_post():
    """An edge from the origin along x turns at 3 revolutions an interval; a point at angle phi is met at phi / (6 pi)."""
    edge = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    spin = FeaturePath(np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 6.0 * np.pi]]))
    rest = FeaturePath(np.zeros((2, 3)), np.zeros((2, 3)))
    for phi in (0.1, 1.0, 3.0, 6.0):
        post = [[0.8 * np.cos(phi), 0.8 * np.sin(phi), -1.0], [0.8 * np.cos(phi), 0.8 * np.sin(phi), 1.0]]
        assert first_contact(edge, spin, post, rest) == pytest.approx(phi / (6.0 * np.pi), abs=1e-14)
    beyond = [[0.0, 1.0 + 1e-9, -1.0], [0.0, 1.0 + 1e-9, 1.0]]
    assert first_contact(edge, spin, beyond, rest) == np.inf


def test_touch_and_tolerance():
    """A point falls 1 m onto a triangle: it comes within `impact_margin` at 1 - impact_margin, and at most `tolerance` before."""
    face = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
    rest = FeaturePath(np.zeros((2, 3)), np.zeros((2, 3)))
    fall = FeaturePath(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), np.zeros((2, 3)))
    assert first_contact(face, rest, [[0.0, 0.0, 0.0]], fall, impact_margin=0.25) == pytest.approx(0.75, abs=1e-15)
    assert 0.65 <= first_contact(face, rest, [[0.0, 0.0, 0.0]], fall, impact_margin=0.25, tolerance=0.1) <= 0.75


def test_bad_input_is_refused():
    rest = FeaturePath(np.zeros((2, 3)), np.zeros((2, 3)))
    point = [[0.0, 0.0, 1.0]]
    with pytest.raises(ValueError, match="1 to 3 corners"):
        first_contact(np.zeros((4, 3)), rest, point, rest)
    with pytest.raises(ValueError, match="finite"):
        first_contact(point, rest, [[np.nan, 0.0, 0.0]], rest)
    with pytest.raises(ValueError, match="without area"):
        first_contact(np.zeros((3, 3)), rest, point, rest)

"""Parts of recordings: the same frames, times from 0 on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.cli.cli import main


@pytest.fixture(scope="module")
def run() -> ri.Recording:
    entry = gallery.load("bounce")
    return ri.simulate(entry.scene(), 2.0, 60.0)


def test_frames_are_those_of_the_whole_run(run: ri.Recording) -> None:
    part = run.part(30, 90)
    np.testing.assert_allclose(part.times, np.arange(61) / 60.0, atol=1e-15)
    for name in run.names:
        np.testing.assert_array_equal(part.position(name), run.position(name)[30:91])
        np.testing.assert_array_equal(part.velocity(name), run.velocity(name)[30:91])
    np.testing.assert_array_equal(part.ledger.total, run.ledger.total[30:91])
    inside = run.impacts[(run.impacts["time"] >= run.times[30]) & (run.impacts["time"] <= run.times[90])]
    assert len(inside) > 0
    np.testing.assert_allclose(part.impacts["time"], inside["time"] - 0.5, atol=1e-15)
    for frame in (0, 17, 60):
        np.testing.assert_array_equal(part.contacts_at(frame)["force"], run.contacts_at(30 + frame)["force"])


def test_the_end_may_be_left_open(run: ri.Recording) -> None:
    assert run.part(0).state_hash() == run.state_hash()
    assert len(run.part(100).times) == len(run.times) - 100
    assert len(run.part(120, 120).times) == 1


@pytest.mark.parametrize(("first", "last"), [(-1, None), (121, None), (5, 4), (0, 121)])
def test_frames_that_are_not_there_are_refused(run: ri.Recording, first: int, last: int | None) -> None:
    with pytest.raises(ri.SceneError, match="frames"):
        run.part(first, last)


def test_a_pre_roll_is_left_out_of_files(tmp_path: Path) -> None:
    out = tmp_path / "out.npz"
    told = CliRunner().invoke(main, ["simulate", "bounce", "--duration", "1", "--fps", "24", "--pre-roll", "8", "-o", str(out)])
    assert told.exit_code == 0, told.output
    assert len(ri.load_recording(out).times) == 17

"""A run goes on only from checkpoints that its user has written, or that the program trusts."""

from __future__ import annotations

import os
import random
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from forged_states import put_state
from kept_runs import gas

import rigidimpulse as ri
from rigidimpulse.cli.cli import main
from rigidimpulse.io.cache.read import read

h5py = pytest.importorskip("h5py")
DURATION, STOP = 0.1, 0.05
VARIABLES = ("XDG_STATE_HOME", "LOCALAPPDATA", "RIGIDIMPULSE_CACHE_KEY")
unix = pytest.mark.skipif(os.name == "nt", reason="rights of files are those of Unix")


@pytest.fixture(autouse=True)
def home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A home of its own, without a key yet."""
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    return tmp_path / "home"


def key_in(home: Path) -> Path:
    return home / ".local" / "state" / "rigidimpulse" / "cache_key"


def stopped(path: Path) -> Path:
    """The cache of a run that was stopped on its way."""

    def stop(now: float) -> None:
        if now >= STOP:
            raise KeyboardInterrupt

    run = ri.simulate(gas(), DURATION, 100.0, cache=ri.Cache(path, every=0.0), progress=stop)
    assert run.status.is_partial
    return path


def go_on(path: Path, trust: bool = False) -> str:
    return ri.simulate(gas(), DURATION, 100.0, cache=ri.Cache(path, trust=trust)).state_hash()


@pytest.fixture
def whole() -> str:
    return ri.simulate(gas(), DURATION, 100.0).state_hash()


@unix
def test_the_key_is_made_once_and_only_its_user_reads_it(home: Path, tmp_path: Path, whole: str) -> None:
    path = stopped(tmp_path / "run.h5")
    key = key_in(home)
    content = key.read_bytes()
    assert len(content) == 32 and stat.S_IMODE(key.stat().st_mode) == 0o600
    assert sorted(entry.name for entry in key.parent.iterdir()) == ["cache_key"]
    assert go_on(path) == whole
    assert key.read_bytes() == content


def test_a_cache_of_another_user_is_shown_and_goes_on_only_where_it_is_trusted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, whole: str
) -> None:
    path = stopped(tmp_path / "run.h5")
    monkeypatch.setenv("HOME", str(tmp_path / "other"))
    (tmp_path / "other").mkdir()
    with pytest.raises(ri.SceneError, match=r"run\.h5.*not written by this user.*trust=True.*delete it"):
        go_on(path)
    assert ri.load_recording(path).status.is_partial
    assert go_on(path, trust=True) == whole
    # From then on it is a cache of this user.
    assert go_on(path) == whole


def test_a_finished_cache_of_another_user_is_refused_too(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, whole: str) -> None:
    path = tmp_path / "run.h5"
    ri.simulate(gas(), DURATION, 100.0, cache=path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    for frame in (None, 3):
        with pytest.raises(ri.SceneError, match="not written by this user"):
            ri.simulate(gas(), DURATION, 100.0, cache=path, from_frame=frame)
    assert ri.load_recording(path).state_hash() == whole
    assert ri.simulate(gas(), DURATION, 100.0, cache=ri.Cache(path, trust=True), from_frame=3).state_hash() == whole


def test_forged_checkpoints_with_right_digests_are_refused(tmp_path: Path, whole: str) -> None:
    path, numbers = stopped(tmp_path / "run.h5"), random.Random(0)
    content, state = path.read_bytes(), read(path)[1].state
    assert state is not None
    for _ in range(30):
        forged = bytearray(state)
        forged[numbers.randrange(len(forged))] ^= 1 << numbers.randrange(8)
        path.write_bytes(content)
        put_state(path, bytes(forged))
        with pytest.raises(ri.SceneError, match="not written by this user"):
            go_on(path)
    # The same way of putting a state there is read where it is trusted.
    path.write_bytes(content)
    put_state(path, state)
    assert go_on(path, trust=True) == whole


def test_a_scene_that_is_put_into_a_cache_is_refused(tmp_path: Path) -> None:
    path, other = tmp_path / "run.h5", tmp_path / "other.h5"
    ri.simulate(gas(), DURATION, 100.0, cache=path)
    changed = gas()
    changed.add(ri.Body("more", ri.Shape.sphere(0.1), position=(0.3, 0.3, 0.3)))
    ri.simulate(changed, DURATION, 100.0, cache=other)
    for name in ("origin", "origin_signature"):
        with h5py.File(path, "r+") as file, h5py.File(other) as source:
            if name == "origin":
                del file["origin"]
                file["origin"], file.attrs["origin"] = source["origin"][()], source.attrs["origin"]
            else:
                file.attrs[name] = source.attrs[name]
        # Signed, too, it is one of another run: the signature has the fingerprint in it.
        with pytest.raises(ri.SceneError, match="not written by this user"):
            ri.simulate(gas(), DURATION, 100.0, cache=path, from_frame=3)


@unix
@pytest.mark.parametrize(("case", "told"), [("no home", "no home"), ("readable", "only this user can read"), ("short", "only this user")])
def test_without_a_key_nothing_is_signed(
    case: str, told: str, home: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, whole: str
) -> None:
    if case == "no home":
        monkeypatch.setenv("XDG_STATE_HOME", "~")
    else:
        key_in(home).parent.mkdir(parents=True)
        key_in(home).write_bytes(bytes(32 if case == "readable" else 3))
        key_in(home).chmod(0o644 if case == "readable" else 0o600)
    path = stopped(tmp_path / "run.h5")
    with pytest.raises(ri.SceneError, match=told):
        go_on(path)
    assert go_on(path, trust=True) == whole


def test_machines_share_a_key_that_a_variable_names(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, whole: str) -> None:
    monkeypatch.setenv("RIGIDIMPULSE_CACHE_KEY", str(tmp_path / "shared" / "key"))
    path = stopped(tmp_path / "run.h5")
    monkeypatch.setenv("HOME", str(tmp_path / "nowhere"))
    assert go_on(path) == whole
    shutil.rmtree(tmp_path / "shared")
    with pytest.raises(ri.SceneError, match="not written by this user"):
        go_on(path)


def test_processes_that_make_the_key_at_once_agree(home: Path) -> None:
    program = "from rigidimpulse.io.cache.signature import signature; print(signature('checkpoint', '', b'').decode())"
    started = [subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) for _ in range(4)]
    told = {process.communicate()[0].strip() for process in started}
    assert len(told) == 1 and len(told.pop()) == 64
    assert sorted(entry.name for entry in key_in(home).parent.iterdir()) == ["cache_key"]


def test_the_command_line_trusts_what_it_is_told_to(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "scene.py").write_text("from rigidimpulse import gallery\n\ndef scene():\n    return gallery.load('bounce').scene()\n")
    cache = str(tmp_path / "run.h5")
    command = ["simulate", str(tmp_path / "scene.py"), "--duration", "0.2", "--cache", cache, "-o", str(tmp_path / "run.npz")]
    assert CliRunner().invoke(main, command).exit_code == 0
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    refused = CliRunner().invoke(main, command)
    assert refused.exit_code != 0 and "--trust-cache" in refused.output
    assert CliRunner().invoke(main, [*command, "--trust-cache"]).exit_code == 0

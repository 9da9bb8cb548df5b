"""`rigidimpulse warmup`: it compiles what is missing, once, and Ctrl-C leaves no processes behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial

import numba
import pytest
from click.testing import CliRunner

from rigidimpulse.cli.cli import BAD_SCENE, main
from rigidimpulse.engine.warm_up import KernelPart
from rigidimpulse.engine.warm_up_all import ALL_PARTS, compile_parts, missing_parts
from rigidimpulse.engine.warm_up_parts import compile_in_turn


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    """A machine that has run nothing yet."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for part in ALL_PARTS:
        # A new folder begins with the notes that lie beside the package.
        part.note().unlink(missing_ok=True)
    return tmp_path


def test_where_all_is_compiled_nothing_is_done(empty_cache):
    assert missing_parts() == list(ALL_PARTS)
    for part in ALL_PARTS:
        part.note().touch()
    before = sorted(empty_cache.rglob("*"))
    result = CliRunner().invoke(main, ["warmup"])
    assert result.exit_code == 0
    assert result.output == "all kernels are compiled: nothing to do\n"
    assert sorted(empty_cache.rglob("*")) == before


def test_a_part_that_is_compiled_is_not_missing_any_more(empty_cache):
    # A kind that there is not: its process fails at once, as one does whose compiler fails.
    told: list[float] = []
    wrong, first = KernelPart("contacts", 7), ALL_PARTS[0]
    first.note().touch()
    assert missing_parts() == list(ALL_PARTS[1:])
    (failed,) = compile_parts([wrong], 2, told.append)
    assert failed.part == wrong and "IndexError" in failed.reason
    assert not wrong.note().exists()
    assert 0.0 <= told[0] <= 1.0 and told[-1] == 1.0 and told == sorted(told)


def test_a_process_that_is_killed_is_told_as_such(empty_cache):
    before = set(processes_below(os.getpid()))

    def kill_new(_done: float) -> None:
        for child in set(processes_below(os.getpid())) - before:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)

    (failed,) = compile_parts([ALL_PARTS[0]], 1, kill_new)
    assert failed.part == ALL_PARTS[0] and failed.reason == "processes ended with -9"


def test_parts_that_lie_in_the_cache_are_loaded_and_noted():
    part = KernelPart("impacts of balls")
    part.note().unlink(missing_ok=True)
    assert compile_parts([part], 1, lambda done: None) == []
    assert part.note().exists() and part not in missing_parts()


def test_kernels_are_compiled_for_this_package_whatever_lies_in_the_present_folder(tmp_path, monkeypatch):
    """In a clone whose package is installed besides, processes compiled those of the clone, and none of 15 parts were there after it."""
    (tmp_path / "rigidimpulse").mkdir()
    (tmp_path / "rigidimpulse" / "__init__.py").write_text("raise ImportError", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    part = KernelPart("impacts of balls")
    part.note().unlink(missing_ok=True)
    assert compile_parts([part], 1, lambda done: None) == []
    assert part.note().exists()


HOLDS = """
import sys, time
from rigidimpulse.engine.warm_up import KernelPart
held = KernelPart("contacts", 7).claim()
print(held is not None, flush=True)
time.sleep(float(sys.argv[1]))
"""


def test_a_part_that_another_process_leaves_undone_is_compiled_here(empty_cache):
    """The other one ends without a note, as where the system kills it. There is no such part: that it is tried shows by its failure."""
    with subprocess.Popen([sys.executable, "-c", HOLDS, "2.0"], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "True\n"
        begin = time.monotonic()
        (failed,) = compile_in_turn([KernelPart("contacts", 7)])
    assert failed.startswith("contacts 7: IndexError")
    assert time.monotonic() - begin > 1.0


def test_a_process_that_hangs_is_not_waited_for_without_end(empty_cache):
    with subprocess.Popen([sys.executable, "-c", HOLDS, "600"], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "True\n"
        (failed,) = compile_in_turn([KernelPart("contacts", 7)], patience=0.01)
        assert other.poll() is None
        other.kill()
    assert failed.startswith("contacts 7: IndexError")


IN_BACKGROUND = """
from rigidimpulse.engine.warm_up import compile_loop_in_background
compile_loop_in_background()
compile_loop_in_background()
input()
"""


def test_what_is_killed_in_the_background_the_next_process_begins_again(empty_cache):
    """A note of the killed one said for ten minutes that it compiled, and runs went on without the kernel, ten times slower."""
    for _ in range(2):
        with subprocess.Popen([sys.executable, "-c", IN_BACKGROUND], stdin=subprocess.PIPE) as first:
            deadline, children = time.monotonic() + 60.0, []
            while not children and time.monotonic() < deadline:
                time.sleep(0.1)
                children = processes_below(first.pid)
            (child,) = children
            while (held := KernelPart("order of events").claim()) is not None and time.monotonic() < deadline:
                held.close()
                time.sleep(0.1)
            os.kill(child, signal.SIGKILL)
            first.kill()
        assert held is None


def test_what_another_process_has_compiled_is_left_out(empty_cache):
    """Were it compiled, it would fail."""
    part = KernelPart("contacts", 7)
    part.note().touch()
    assert compile_in_turn([part]) == []


def test_control_c_ends_it_and_all_its_processes(empty_cache):
    command = [sys.executable, "-m", "rigidimpulse", "warmup", "--processes", "2"]
    # Where the tests run in the background of a shell, Ctrl-C is left out for all that they start.
    hears = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    warm = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=hears)
    deadline, children = time.monotonic() + 60.0, []
    while len(children) < 2 and time.monotonic() < deadline:
        time.sleep(0.1)
        children = processes_below(warm.pid)
    assert len(children) == 2
    warm.send_signal(signal.SIGINT)
    out, _ = warm.communicate(timeout=30)
    assert warm.returncode == 1 and "once on this machine" in out
    assert not [child for child in children if is_alive(child)]


def test_a_number_of_processes_that_makes_no_sense_is_refused():
    assert CliRunner().invoke(main, ["warmup", "--processes", "0"]).exit_code == BAD_SCENE


def processes_below(process: int) -> list[int]:
    """Ids of the processes that one has started."""
    listed = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    return [int(pid) for pid, parent in map(str.split, listed.splitlines()) if int(parent) == process]


def is_alive(process: int) -> bool:
    """Whether there is a process of this id."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True

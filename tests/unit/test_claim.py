"""A claim is held by one process at a time, and ends with it, however it ends."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from rigidimpulse.core.claim import claim

HOLDER = """
import sys, time
from pathlib import Path
from rigidimpulse.core.claim import claim
held = claim(Path(sys.argv[1]))
print(held is not None, flush=True)
time.sleep(60)
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there every process compiles for itself")


def test_a_claim_is_held_until_it_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    held = claim(path)
    assert held is not None and claim(path) is None
    held.close()
    again = claim(path)
    assert again is not None
    again.close()


def test_a_claim_ends_with_a_process_that_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline().strip() == "True"
        assert claim(path) is None
        process.kill()
        process.wait()
    held = claim(path)
    assert held is not None
    held.close()


def test_a_claim_in_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError):
        claim(tmp_path / "nowhere" / "lock")

"""The live page in a real browser: frames come while they are computed, and what people do there changes the run.

Poses come to the page as float32, so a frame of the page equals that of `simulate` rounded to float32.
"""

from __future__ import annotations

import gc
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import Opened, open_page

from rigidimpulse.engine.simulate import simulate
from rigidimpulse.studies.job import find_job

pytestmark = pytest.mark.browser

TIMEOUT = 20_000  # ms, of a machine that compiles
FLOAT32_ROUNDING = 2.0**-24
SCENE = """
import rigidimpulse as ri

def scene(height: float = 1.0):
    made = ri.Scene()
    made.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    made.add(ri.Body("ball", ri.Shape.sphere(0.25), position=(0, 0, 0.25 + height), material=ri.Material(restitution=0.5)))
    return made
"""
GRAVITY, RADIUS = 9.81, 0.25


class Command:
    """`rigidimpulse live` as people start it, in a session of its own."""

    def __init__(self, file: Path, *options: str) -> None:
        """Start it and wait for the line with the address."""
        arguments = [sys.executable, "-u", "-m", "rigidimpulse", "live", str(file), "--no-open", *options]
        # Where the tests run in the background of a shell, Ctrl-C is left out for all that they start.
        hears = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
        self.process = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=hears)
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        found = re.search(r"http://\S+", line)
        assert found is not None, line
        self.url = found.group(0)

    def family(self) -> list[int]:
        """Process identifiers of the command and of all that it has started, directly or not, that are alive."""
        parent = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                except OSError:
                    continue
                if fields[0] != "Z":
                    parent[int(entry.name)] = int(fields[1])
        known = {self.process.pid}
        while more := {pid for pid, of in parent.items() if of in known} - known:
            known |= more
        return sorted(known & set(parent))

    def interrupt(self) -> int:
        """Press Ctrl-C and return the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(10)

    def end(self) -> None:
        """End it if a test has not."""
        if self.process.poll() is None:
            self.interrupt()
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Command, Path]]:
    """One live scene for all tests of the module that leave it alive, and its file."""
    file = tmp_path_factory.mktemp("live") / "drop.py"
    file.write_text(SCENE)
    started = Command(file, "--duration", "2")
    yield started, file
    started.end()


@pytest.fixture(scope="module")
def first_page(command: tuple[Command, Path], browser: Any) -> Iterator[Opened]:
    """Its page."""
    opened = open_page(browser, command[0].url, 640, 480)
    yield opened
    opened.page.close()


@pytest.fixture
def page(command: tuple[Command, Path], first_page: Opened) -> Iterator[Opened]:
    """The page, when the scene as it is written has been computed."""
    if command[1].read_text() != SCENE:
        command[1].write_text(SCENE)
    if not first_page.page.evaluate("document.getElementById('reset').hidden"):  # something was changed on the page
        first_page.page.evaluate("window.rigidimpulse.page.send({do: 'reset'})")
    first_page.page.evaluate("document.getElementById('controls').open = false")
    as_written = f"Math.abs(r.player.poses[2] - {1.0 + RADIUS}) < 1e-6 && document.querySelectorAll('#rows .changed').length === 0"
    wait(first_page, f"r.doing === 'done' && r.page.throws === 0 && {as_written}")
    yield first_page
    assert first_page.errors == []


def wait(opened: Opened, condition: str) -> None:
    """Wait until something is so; `r` is the page's rigidimpulse object."""
    opened.page.wait_for_function(f"() => {{ const r = window.rigidimpulse; return r && r.page.stage && {condition}; }}", timeout=TIMEOUT)


def again(opened: Opened, act: Callable[[], Any]) -> float:
    """Do something that has the scene run again; return the seconds until that run is computed."""
    number, start = opened.do("r.number"), time.perf_counter()
    act()
    wait(opened, f"r.number > {number} && r.doing === 'done'")
    return time.perf_counter() - start


def slide(opened: Opened, name: str, value: float) -> None:
    """Move a slider."""
    script = "([name, value]) => { const input = document.querySelector(`[data-name='${name}'] input`); input.value = value; "
    opened.page.evaluate(script + "input.dispatchEvent(new Event('input', {bubbles: true})); }", [name, value])


def heights(opened: Opened) -> np.ndarray:
    """Heights (f,) m of the ball in all frames of the page."""
    return np.array(opened.do("[...r.player.poses]")).reshape(-1, 7)[:, 2]


def first_impact(opened: Opened) -> float:
    """Time of the first impact on the page, s."""
    return opened.do("r.page.arrows.rows[0]")


def test_the_frames_are_those_of_simulate(page: Opened, command: tuple[Command, Path]) -> None:
    run = simulate(find_job(str(command[1])).make(), 2.0)
    expected = np.concatenate([run.position("ball"), run.orientation("ball")[:, [1, 2, 3, 0]]], axis=1)
    found = np.array(page.do("[...r.player.poses]")).reshape(-1, 7)
    assert np.all(np.abs(found - expected) <= FLOAT32_ROUNDING * (1.0 + np.abs(expected)))
    assert page.do("r.page.arrows.count") == len(run.impacts)
    page.do("r.player.seek(1.5)")
    assert np.allclose(page.do("r.pose('ball')")[:3], run.position("ball")[90], atol=1e-6)


def test_moving_a_declared_slider_changes_the_motion_and_keeps_camera_and_time(page: Opened) -> None:
    page.do("r.player.pause(), r.player.seek(1.25)")
    page.page.wait_for_timeout(700)  # the camera has come to rest
    camera = page.do("r.camera()")
    again(page, lambda: slide(page, "height", 1.8))
    assert first_impact(page) == pytest.approx(np.sqrt(2 * 1.8 / GRAVITY), rel=1e-5)
    assert page.do("r.camera()") == camera
    assert page.do("r.player.time") == pytest.approx(1.25)
    assert page.page.text_content("[data-name='height'] output") == "1.8"


def test_every_scene_has_sliders_of_its_own(page: Opened) -> None:
    def fall(heights: np.ndarray) -> float:
        return float(heights[12] - (RADIUS + 1.0 - 0.5 * 5.0 * 0.2**2))

    def rebound(heights: np.ndarray) -> float:
        return float(heights[60:].max() - RADIUS)

    for name, value, law in (("restitution", 0.0, rebound), ("gravity", 5.0, fall)):
        assert abs(law(heights(page))) > 0.05
        again(page, lambda name=name, value=value: slide(page, name, value))
        assert abs(law(heights(page))) < 1e-4


def test_mass_friction_and_accuracy_are_there_too(page: Opened) -> None:
    page.do("document.getElementById('controls').open = true")
    strongest = page.do("r.page.arrows.largest")
    again(page, lambda: slide(page, "mass", float(np.log(4.0))))
    assert page.do("r.page.arrows.largest") == pytest.approx(4.0 * strongest, rel=1e-3)
    again(page, lambda: page.page.select_option("[data-name='accuracy'] select", "preview"))
    again(page, lambda: slide(page, "friction", 1.0))
    assert page.page.locator("#rows .changed").count() == 3
    again(page, lambda: page.page.click("#reset"))
    assert page.page.locator("#rows .changed").count() == 0
    assert page.do("r.page.arrows.largest") == pytest.approx(strongest, rel=1e-6)


def test_a_saved_file_runs_again(page: Opened, command: tuple[Command, Path]) -> None:
    seconds = again(page, lambda: command[1].write_text(SCENE.replace("0.25 + height", "0.25 + 2 * height")))
    assert first_impact(page) == pytest.approx(np.sqrt(2 * 2.0 / GRAVITY), rel=1e-5)
    assert seconds < 3.0


def test_an_error_is_shown_with_its_line_and_goes_away_when_mended(page: Opened, command: tuple[Command, Path]) -> None:
    lines, line = SCENE.splitlines(), 7
    before = heights(page)
    for mistake, text in (
        ("made.add(ri.Body('ball' ri.Shape.sphere(1)))", "SyntaxError"),
        ("made.add(ri.Body('box', ri.Shape.boxx((1, 1, 1))))", "boxx"),
        ("made.add(ri.Body('box', ri.Shape.box((1, -1, 1))))", "-1"),
        ("made.add(ri.Body('box', ri.Shape.sphere(1), mass=-2))", "-2"),
    ):
        command[1].write_text("\n".join([*lines[: line - 1], f"    {mistake}", *lines[line - 1 :]]) + "\n")
        page.page.wait_for_function("text => document.getElementById('problem').innerText.includes(text)", arg=mistake, timeout=TIMEOUT)
        shown = page.page.inner_text("#problem")
        assert f"Line {line}" in shown and text in shown
        assert np.array_equal(heights(page), before)
    again(page, lambda: command[1].write_text(SCENE))
    assert page.page.is_hidden("#problem")


def test_a_scene_that_never_comes_back_is_given_up_when_it_is_mended(page: Opened, command: tuple[Command, Path]) -> None:
    command[1].write_text("while True:\n    pass\n")
    wait(page, "r.doing === 'making'")
    assert again(page, lambda: command[1].write_text(SCENE)) < TIMEOUT / 1e3
    assert page.page.is_hidden("#problem") and page.do("r.doing") == "done"


def test_a_body_is_thrown(page: Opened) -> None:
    page.do("r.player.pause(), r.player.seek(0.3)")  # above the bar
    page.page.wait_for_function("() => window.rigidimpulse.page.stage.way === null", timeout=TIMEOUT)  # the camera has come to rest
    frame, before = page.do("r.player.frame"), heights(page)
    x, y = page.do("r.onScreen('ball')")
    mouse = page.page.mouse

    def throw() -> None:
        mouse.move(x, y)
        mouse.down()
        mouse.move(x + 30, y - 140, steps=4)
        assert "m/s" in page.page.inner_text("#throw")
        mouse.up()

    camera = page.do("r.camera()")
    again(page, throw)
    after = np.array(page.do("[...r.player.poses]")).reshape(-1, 7)
    assert np.array_equal(after[: frame + 1, 2], before[: frame + 1])
    rise = (after[frame + 1, 2] - after[frame, 2]) * 60.0 + 0.5 * GRAVITY / 60.0
    assert rise > 1.0  # m/s, upwards as it was dragged; the ball fell or stood
    assert np.linalg.norm(after[-1, :2]) > 0.2
    assert page.do("r.camera()") == camera
    assert page.do("r.page.throws") == 1


def test_play_pause_restart_and_steps_by_impact(page: Opened) -> None:
    keyboard = page.page.keyboard
    page.do("r.player.pause(), r.player.seek(0)")
    times = [page.do(f"r.page.arrows.rows[{12 * k}]") for k in range(2)]
    for expected in times:
        keyboard.press("]")
        assert page.do("r.player.time") == pytest.approx(expected, abs=1e-6)
    keyboard.press("[")
    assert page.do("r.player.time") == pytest.approx(times[0], abs=1e-6)
    assert len(page.do("r.visibleArrows()")) == 1
    keyboard.press("r")
    assert page.do("r.player.playing")
    page.page.wait_for_function(f"window.rigidimpulse.player.time < {times[0]}")
    keyboard.press(" ")
    time_now = page.do("r.player.time")
    page.page.wait_for_timeout(120)
    assert page.do("[r.player.playing, r.player.time]") == [False, time_now]


def test_impacts_are_spikes_and_hills_as_on_the_page_of_a_recording(page: Opened) -> None:
    mouse, marks = page.page.mouse, page.page.locator("#marks").bounding_box()
    page.do("r.player.pause(), r.player.seek(0)")
    groups = "r.page.timeline.line.groups.map((group) => group.map(({time, x, count}) => ({time, x, count})))"
    found = page.do(groups)
    assert sum(spike["count"] for group in found for spike in group) == page.do("r.page.arrows.count")  # the floor has no arrow
    assert len(found[0]) == 1 and found[0][0]["time"] == pytest.approx(first_impact(page))
    mouse.click(marks["x"] + found[0][0]["x"], marks["y"] + marks["height"] - 24)
    assert page.do("r.player.time") == pytest.approx(first_impact(page), abs=1e-6) and not page.do("r.player.playing")
    dark = page.page.evaluate("document.documentElement.dataset.theme")
    page.page.click("#theme-button")
    assert page.page.evaluate("document.documentElement.dataset.theme") != dark
    page.page.click("#theme-button")


def test_a_page_that_is_opened_later_shows_the_same_and_its_address_holds_values(
    page: Opened, command: tuple[Command, Path], browser: Any
) -> None:
    other = open_page(browser, command[0].url + "?height=1.5&unknown=1", 390, 700)
    wait(page, f"r.doing === 'done' && Math.abs(r.player.poses[2] - {1.5 + RADIUS}) < 1e-6")
    wait(other, f"r.player.complete && Math.abs(r.player.poses[2] - {1.5 + RADIUS}) < 1e-6")
    assert np.array_equal(heights(other), heights(page))
    assert other.page.url == page.page.url == command[0].url + "?height=1.5"
    assert other.errors == []
    assert all(request.startswith(("http://127.0.0.1", "data:")) for request in other.requests)
    other.page.close()


@pytest.mark.filterwarnings("ignore:Unclosed socket:ResourceWarning")  # a Visualizer leaves one behind
def test_meshcats_own_visualizer_adds_to_the_picture(page: Opened, command: tuple[Command, Path]) -> None:
    import meshcat
    import meshcat.geometry

    shown = meshcat.Visualizer(zmq_url="tcp://127.0.0.1:6000")
    try:
        if shown.url() != command[0].url:
            pytest.skip("another meshcat server holds the first port")
        shown["mine"].set_object(meshcat.geometry.Box([0.1, 0.2, 0.3]))
        wait(page, "r.viewer.scene_tree.find(['meshcat', 'mine', '<object>']).object.isMesh")
        box = page.do("r.viewer.scene_tree.find(['meshcat', 'mine', '<object>']).object.geometry.parameters")
        assert sorted(box[side] for side in ("width", "height", "depth")) == pytest.approx([0.1, 0.2, 0.3])
    finally:
        shown.window.zmq_socket.close(0)
        del shown
        gc.collect()


def test_only_this_machine_is_listened_to_and_only_by_its_name(command: tuple[Command, Path]) -> None:
    port = int(command[0].url.rsplit(":", 1)[1].split("/")[0])
    with socket.socket() as other:
        other.settimeout(2.0)
        assert other.connect_ex((own_address(), port)) != 0 or own_address() == "127.0.0.1"
    for host, code in ((f"127.0.0.1:{port}", b"200"), ("evil.example", b"404")):
        with socket.create_connection(("127.0.0.1", port), 2.0) as asked:
            asked.sendall(f"GET /static/ HTTP/1.0\r\nHost: {host}\r\n\r\n".encode())
            assert asked.recv(64).split()[1] == code


def own_address() -> str:
    """Address of this machine in its network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        try:
            asked.connect(("192.0.2.1", 9))
        except OSError:
            return "127.0.0.1"
        return asked.getsockname()[0]


def test_pictures_come_while_a_run_is_computed_and_ctrl_c_leaves_no_process(tmp_path: Path, browser: Any) -> None:
    started = Command(slow_scene(tmp_path), "--duration", "600", "--accuracy", "exact")
    try:
        opened = open_page(browser, started.url, 240, 160)
        wait(opened, "r.doing === 'computing' && r.player.count > 60")
        # How fast they come depends on what else runs (50 lots a second where nothing does): that they come is what counts here.
        lots, pictures = opened.do("[r.page.lots, r.page.pictures]")
        wait(opened, f"r.doing === 'computing' && r.page.lots >= {lots + 15} && r.page.pictures > {pictures}")
        family = started.family()
        assert len(family) >= 2
        assert started.interrupt() == 0
        left = [pid for pid in family if Path(f"/proc/{pid}").exists() and alive(pid)]
        assert left == []
        wait(opened, "r.doing === 'lost'")
        opened.page.close()
    finally:
        started.end()


def test_a_killed_command_takes_its_worker_along(tmp_path: Path) -> None:
    started = Command(slow_scene(tmp_path), "--duration", "600", "--accuracy", "exact")
    try:
        family = started.family()
        assert len(family) >= 2
        os.kill(started.process.pid, signal.SIGKILL)
        started.process.wait(5)
        end = time.perf_counter() + 5.0
        while any(alive(pid) for pid in family) and time.perf_counter() < end:
            time.sleep(0.05)
        assert not any(alive(pid) for pid in family)
    finally:
        started.end()


def slow_scene(folder: Path) -> Path:
    """A scene that takes long to compute: boxes that never come to rest."""
    file = folder / "slow.py"
    text = SCENE.replace("return made", 'for k in range(8):\n        made.add(ri.Body(f"box {k}", ri.Shape.box((0.3, 0.3, 0.3)), '
                         "position=(1 + 0.1 * k, 0, 0.4 + 0.5 * k), angular_velocity=(1, 2, 3), "
                         "material=ri.Material(restitution=1.0, static_friction=0.0)))\n    return made")  # fmt: skip
    file.write_text(text.replace('"floor", ri.Shape.half_space(), motion="static"', '"floor", ri.Shape.half_space(), motion="static", '
                                 "material=ri.Material(restitution=1.0)"))  # fmt: skip
    return file


def alive(pid: int) -> bool:
    """Whether a process runs."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False

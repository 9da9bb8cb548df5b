"""`ri.live`: a scene on meshcat's live page while it is computed.

Three things go on at the same time: meshcat's server in a thread, the worker in a process of its own, and a thread that watches the scene's
file. What people do on a page, and a file that is saved, becomes a request with the next number.
"""

from __future__ import annotations

import atexit
import html
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigidimpulse.core.errors import SceneError
from rigidimpulse.studies.live.process import OF_RUN, WorkerProcess
from rigidimpulse.studies.live.request import Request, Source, Throw

if TYPE_CHECKING:
    from rigidimpulse.scene.scene import Scene
    from rigidimpulse.view.live.server import LiveServer

LOOK = 0.1
"""s between two looks at the scene's file."""
FRAME_HEIGHT = 520
"""Pixels of the view in a notebook."""


def live(
    scene: str | Path | Scene | Callable[..., Scene],
    duration: float | None = None,
    fps: float | None = None,
    *,
    accuracy: str | None = None,
    open_browser: bool = True,
) -> Live:
    """Show a scene on a live page while it is computed, and let people change and throw things there.

    The page is served by meshcat's own server at `Live.url`, on this machine only. A scene file runs again whenever it is saved. The call
    returns at once; `Live.wait` keeps a script going until Ctrl-C. In a notebook the result is shown in its cell.

    Args:
        scene: what `rigidimpulse simulate` takes (a name, a .py or another scene file), a Scene, or a function that returns one; the
            arguments of a function become sliders, see docs/guide/live.md.
        duration: s; by default that of the scene, or 4.
        fps: frames per second; by default those of the scene, or 60.
        accuracy: "preview", "standard" or "exact".
        open_browser: open the page; False: only serve it.

    Raises:
        SceneError: a function that is not in a scene file cannot be called, or returns no Scene.
        OSError: no port is free.

    """
    chosen = {"duration": duration, "fps": fps, "accuracy": accuracy}
    shown = Live(scene, {name: value for name, value in chosen.items() if value is not None})
    print(f"rigidimpulse: {shown.url}")
    if open_browser:
        webbrowser.open(shown.url)
    return shown


class Live:
    """A scene on a live page; a context manager that closes itself. `live` makes one.

    Attributes:
        url: address of the page, meshcat's own.
        values: what was chosen on the page, by the name of the control.
        throws: the throws, in the order in which they were made.

    """

    def __init__(self, scene: str | Path | Scene | Callable[..., Scene], settings: dict[str, Any]) -> None:
        """Start the worker, the server and the first run; settings: duration [s], fps, accuracy, as far as they are given."""
        self.values: dict[str, Any] = {}
        self.throws: tuple[Throw, ...] = ()
        self._scene, self._settings = scene, settings
        self._number = self._begun = 0
        self._closed = threading.Event()
        self._lock = threading.RLock()
        # Before anything else: it takes the worker longer to start than all the rest.
        self._server: LiveServer | None = None
        self._served = threading.Event()
        self._worker = WorkerProcess(self._receive)
        try:
            self._source()  # an error in a function of the caller's own is the caller's
            self.run_again()
            from rigidimpulse.view.live.server import LiveServer

            self._server = LiveServer(self._name, self._command)
        except BaseException:
            self._worker.close()
            raise
        finally:
            self._served.set()
        self.url: str = self._server.url
        atexit.register(self.close)
        self._watcher = threading.Thread(target=self._watch, name="rigidimpulse-watch", daemon=True)
        self._watcher.start()

    @property
    def zmq_url(self) -> str:
        """Where a `meshcat.Visualizer(zmq_url=...)` connects to add things to the picture."""
        assert self._server is not None
        return self._server.zmq_url

    @property
    def _name(self) -> str:
        """What the page calls the scene."""
        if isinstance(self._scene, str | Path):
            return Path(self._scene).stem
        return getattr(self._scene, "__name__", "scene")

    def _source(self) -> Source:
        """What is run, with the chosen values where it is made here."""
        scene = self._scene
        if isinstance(scene, str | Path):
            return Source(self._name, str(scene), settings=self._settings)
        if not callable(scene):
            return Source(self._name, scene=scene, settings=self._settings)
        from rigidimpulse.scene.scene import Scene
        from rigidimpulse.studies.job import DEFAULT_DURATION, DEFAULT_FPS, Job
        from rigidimpulse.studies.live.controls import declared_controls, make_scene

        made = make_scene(Job(self._name, scene, DEFAULT_DURATION, DEFAULT_FPS, "standard", None), self.values)
        if not isinstance(made, Scene):
            raise SceneError(f"{self._name}() returned a {type(made).__name__}", "return a Scene")
        return Source(self._name, scene=made, controls=tuple(declared_controls(scene)), settings=self._settings)

    def run_again(self) -> None:
        """Compute the scene from its start, in the place of what is being computed."""
        with self._lock:
            try:
                source = self._source()
            except Exception as error:
                self._show_error(error)
                return
            self._number += 1
            self._worker.ask(Request(self._number, source, dict(self.values), self.throws))

    def _show_error(self, error: Exception) -> None:
        """Show on the page what went wrong in a function of the caller's own; raise it if there is no page yet."""
        if self._server is None:
            raise error
        from rigidimpulse.studies.live.problem import problem_of
        from rigidimpulse.view.live.messages import text_message

        state = {"number": self._number, "doing": "failed", "problem": problem_of(error, "")}
        self._server.publish("state", text_message("state", state))

    def set(self, name: str, value: Any) -> None:
        """Choose the value of a control and run again; None: as the scene has it."""
        with self._lock:
            if value is None:
                self.values.pop(name, None)
            else:
                self.values[name] = value
            self.run_again()

    def throw(self, body: str, time: float, velocity: tuple[float, float, float]) -> None:
        """Give a body another velocity [m/s] at a time [s]; the run is the same until then. Later throws are taken back."""
        with self._lock:
            earlier = tuple(throw for throw in self.throws if throw.time < time)
            self.throws = (*earlier, Throw(body, float(time), velocity))
            self.run_again()

    def reset(self) -> None:
        """Take back all that was chosen and thrown, and run the scene as it is written."""
        with self._lock:
            self.values.clear()
            self.throws = ()
            self.run_again()

    def _command(self, command: dict[str, Any]) -> None:
        """Do what somebody asks for on a page."""
        actions: dict[str, Callable[[], None]] = {
            "set": lambda: self.set(str(command["name"]), command["value"]),
            "throw": lambda: self.throw(command["body"], command["time"], _vector(command["velocity"])),
            "reset": self.reset,
        }
        action = actions.get(str(command.get("do")))
        try:
            if action is not None:
                action()
        except (KeyError, TypeError, ValueError):
            return  # not from our page

    def _receive(self, number: int, kind: str, message: dict[str, Any]) -> None:
        """Hand a message of the worker on to the pages."""
        self._served.wait()
        server = self._server
        if server is None:
            return
        if kind in ("shape", "begin") and self._begun != number:
            self._begun = number
            for each in OF_RUN:
                server.forget(each)
        if kind not in OF_RUN:
            kind = "state"
        if kind in ("state", "framing"):
            server.forget(kind)  # only the last one counts
        server.publish(kind, message)

    def _watch(self) -> None:
        """Run again when the scene's file is saved, and when the worker is gone."""
        known = self._stamp()
        while not self._closed.wait(LOOK):
            ended = self._worker.look()
            if ended:
                self._show_error(SceneError(ended, "save the scene or change something to start it again; the terminal may say more"))
            stamp = self._stamp()
            if stamp is not None and stamp != known:
                known = stamp
                self.run_again()

    def _stamp(self) -> tuple[int, int, int] | None:
        """What changes when the scene's file is saved; None if there is none at the moment."""
        if not isinstance(self._scene, str | Path):
            return None
        try:
            status = Path(self._scene).stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_size, status.st_ino

    def wait(self) -> None:
        """Keep the page up until Ctrl-C, then close."""
        try:
            while not self._closed.wait(1.0):
                pass
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """End the worker and the server; a second call does nothing."""
        with self._lock:
            if self._closed.is_set():
                return
            self._closed.set()
        self._worker.close()
        if self._server is not None:
            self._server.close()
        atexit.unregister(self.close)

    def _repr_html_(self) -> str:
        """The page in a cell of a notebook."""
        style = f"width: 100%; height: {FRAME_HEIGHT}px; border: none; border-radius: 12px"
        return f'<iframe src="{html.escape(self.url)}" style="{style}" title="{html.escape(self._name)}"></iframe>'

    def __enter__(self) -> Live:
        """Return the page itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()


def _vector(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z

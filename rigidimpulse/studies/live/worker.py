"""The process that computes: it takes requests through a pipe and sends messages for the page back.

A request that comes while a run is under way is made ready between two steps of it. If that works, the run is given up for it; if not, the
error is sent and the run goes on. The process ends when its pipe does, however the other process ended.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.frame_times import frame_times
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.job import DEFAULT_DURATION, DEFAULT_FPS, Job, find_job
from rigidimpulse.studies.live.channel import Channel
from rigidimpulse.studies.live.controls import all_controls, make_scene, own_controls, with_own_values
from rigidimpulse.studies.live.problem import problem_of
from rigidimpulse.studies.live.request import Request
from rigidimpulse.view.live.messages import begin_messages, text_message

MAKING, PREPARING, STEPPING, COMPILING, DONE, FAILED = "making", "preparing", "computing", "compiling", "done", "failed"
"""What the process does: it runs people's own code, makes ready, steps, or compiles kernels meanwhile; or how that ended."""


@dataclass(frozen=True)
class Prepared:
    """A run that can be stepped, and the messages with which it begins; none if they were sent already."""

    request: Request
    job: Job
    run: Any
    messages: list[dict[str, Any]]


class Superseded(Exception):
    """Another run is to be computed instead."""

    def __init__(self, prepared: Prepared) -> None:
        """Keep that run."""
        super().__init__()
        self.prepared = prepared


class Inbox:
    """The newest request; those before it that nobody took are forgotten."""

    def __init__(self, channel: Channel) -> None:
        """Listen to a channel, in a thread of its own."""
        self._channel = channel
        self._newest: Request | None = None
        self._changed = threading.Condition()
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        while True:
            try:
                request = self._channel.receive()
            except EOFError:
                _end()
            with self._changed:
                self._newest = request
                self._changed.notify()

    def take(self, wait: bool) -> Request | None:
        """Return the newest request and forget it; None if there is none and it is not to be waited for."""
        with self._changed:
            while self._newest is None and wait:
                self._changed.wait()
            request, self._newest = self._newest, None
            return request


class Worker:
    """Computes one run after the other."""

    def __init__(self, channel: Channel) -> None:
        """Of a channel to the process that shows the runs."""
        self._channel, self._inbox = channel, Inbox(channel)
        self._has_begun = self._listens = False
        self._number, self._doing = 0, MAKING

    def serve(self) -> None:
        """Compute what is asked for, for ever."""
        while True:
            request = self._inbox.take(wait=True)
            prepared = self._prepare(request) if request is not None else None
            while prepared is not None:
                try:
                    self._compute(prepared)
                    prepared = None
                except Superseded as superseded:
                    prepared = superseded.prepared

    def _prepare(self, request: Request) -> Prepared | None:
        """Make a run ready; None if that fails, which is said then."""
        number, file = request.number, request.source.file
        try:
            self._tell(number, MAKING)
            job, scene, controls = _scene_of(request)
            times = frame_times(job.duration, job.fps)
            panel = {
                "controls": [asdict(control) for control in controls],
                "chosen": {name: value for name, value in request.values.items() if any(name == control.name for control in controls)},
                "throws": len(request.throws),
            }
            messages = begin_messages(number, scene, times, panel)
            if not self._has_begun:
                self._begin(number, messages)
                messages = []
            self._tell(number, PREPARING)
            self._listen_to_compilation()
            from rigidimpulse.engine.simulate import prepare
            from rigidimpulse.studies.live.throws import Throws

            assert isinstance(job.accuracy, str | Accuracy)
            run = prepare(scene, times, job.accuracy)
            if request.throws:
                run.keyframes = Throws(run, request.throws)
            return Prepared(request, job, run, messages)
        except Exception as error:
            self._fail(number, error, file)
            return None

    def _compute(self, prepared: Prepared) -> None:
        """Step a run to its end; raises Superseded where another one is asked for meanwhile."""
        from rigidimpulse.engine.loop import run_to_end
        from rigidimpulse.engine.recording_of import finish_run
        from rigidimpulse.studies.live.tap import Tap

        number, run, duration, start = prepared.request.number, prepared.run, prepared.job.duration, perf_counter()
        self._begin(number, prepared.messages)
        self._tell(number, STEPPING)
        tap = Tap(run, lambda message: self._send(number, message))

        def progress(time: float) -> None:
            request = self._inbox.take(wait=False)
            other = self._prepare(request) if request is not None else None
            if other is not None:
                raise Superseded(other)
            tap.look(time)

        try:
            run_to_end(run, duration, progress)
            recording = finish_run(run, duration)
            tap.finish(recording)
            self._tell(number, DONE, seconds=perf_counter() - start, warnings=list(recording.status.warnings))
        except Superseded:
            raise
        except Exception as error:
            self._fail(number, error, prepared.request.source.file)

    def _begin(self, number: int, messages: list[dict[str, Any]]) -> None:
        """Let the page begin with a run."""
        for message in messages:
            self._send(number, message)
        self._has_begun = True

    def _fail(self, number: int, error: Exception, file: str) -> None:
        """Tell people what is wrong; what is not theirs is printed in full."""
        problem = problem_of(error, file)
        if problem["line"] is None and not isinstance(error, ValueError):
            traceback.print_exception(error)
        self._tell(number, FAILED, problem=problem)

    def _listen_to_compilation(self) -> None:
        """From the first run on, once: numba takes long to import."""
        if not self._listens:
            from rigidimpulse.core.compilation import watch_compilation

            self._listens = True
            watch_compilation(self._tell_compiling)

    def _tell_compiling(self, begins: bool) -> None:
        """Say that kernels are being compiled, or go on with what was said before."""
        number, doing = self._number, self._doing
        self._tell(number, COMPILING if begins else doing)
        self._doing = doing

    def _tell(self, number: int, doing: str, **more: Any) -> None:
        """Say what the process does."""
        self._number, self._doing = number, doing
        self._channel.send((number, doing, text_message("state", {"number": number, "doing": doing, **more})))

    def _send(self, number: int, message: dict[str, Any]) -> None:
        self._channel.send((number, message["property"], message))


def _scene_of(request: Request) -> tuple[Job, Scene, list[Any]]:
    """Return the job of a request, its scene with all chosen values, and the controls with the values of the scene itself."""
    source, values = request.source, request.values
    if source.scene is not None:
        job = Job(source.name, Scene, DEFAULT_DURATION, DEFAULT_FPS, "standard", None)._replace(**source.settings)
        declared = list(source.controls)
        names = {control.name for control in declared}
        controls = declared + [each for each in own_controls(source.scene, job) if each.name not in names]
        made = source.scene
        values = {name: value for name, value in values.items() if name not in names}
    else:
        job = find_job(source.file)._replace(**source.settings)
        made = make_scene(job, values)
        controls = all_controls(made, job)
    scene, job = with_own_values(made, job, values)
    return job, scene, controls


def _end() -> None:
    """End this process, whatever its main thread does, and those that compile kernels for it: nobody is left to see it."""
    if hasattr(os, "killpg") and os.getpgid(0) == os.getpid():
        os.killpg(os.getpid(), signal.SIGKILL)
    os._exit(0)


def main() -> None:
    """Serve the process that started this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches both processes; this one ends with the other
    outgoing = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a scene file prints must not get among the messages
    Worker(Channel(sys.stdin.buffer, outgoing)).serve()


if __name__ == "__main__":
    main()

"""Runs of `simulate_many` on several processes: results in order, some ahead of the one that is waited for, and deaths survived."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import islice
from multiprocessing.reduction import ForkingPickler
from typing import Any

from rigidimpulse.core.errors import SceneError
from rigidimpulse.studies.many import Task, VariedRun, failure
from rigidimpulse.studies.wedges.workers import one_thread

AHEAD = 16
"""Runs for each process that are under way, or done and not asked for yet: a long one keeps the others busy for that time."""
_TASKS: list[Task] = []
"""That of a worker process."""


@dataclass(frozen=True)
class _Job:
    """A variation that was handed to a process."""

    number: int
    parameters: Mapping[str, Any]
    future: Future


def check_sending(task: Task) -> None:
    """Raise a SceneError for a task that cannot be sent to other processes."""
    try:
        ForkingPickler.dumps(task)
    except Exception as error:
        raise SceneError(
            f"scene or keep cannot be sent to other processes: {error}", "use functions that stand at the top of a module, or processes=1"
        ) from None


def run_on_several(task: Task, jobs: Iterator[tuple[int, Mapping[str, Any]]], processes: int | None) -> Iterator[VariedRun]:
    """Run numbered variations of a task. Raises a SceneError, when the first is asked for, if no process can be started."""
    number = processes or os.cpu_count() or 1
    pool, alone, waiting = _Pool(task, number), _Pool(task, 1), deque[_Job]()
    try:
        while True:
            waiting.extend(pool.submit(*job) for job in islice(jobs, AHEAD * number - len(waiting)))
            if not waiting:
                return
            if not _is_lost(waiting[0]):
                yield _result(waiting.popleft())
                continue
            # All that ran then are lost: one by one, so that it is known who dies.
            pool.end()
            while waiting:
                job = waiting.popleft()
                if _is_lost(job):
                    job = alone.submit(job.number, job.parameters)
                    if _is_lost(job):
                        alone.end()
                yield _result(job)
            alone.end()
    finally:
        pool.end()
        alone.end()


class _Pool:
    """Processes that start when the first variation is handed to them."""

    def __init__(self, task: Task, number: int) -> None:
        self._task, self._number = task, number
        self._executor: ProcessPoolExecutor | None = None

    def submit(self, number: int, parameters: Mapping[str, Any]) -> _Job:
        """Hand a variation to a process."""
        if self._executor is None:
            self._executor = _start(self._task, self._number)
        try:
            return _Job(number, parameters, self._executor.submit(_run, number, parameters))
        except BrokenProcessPool as error:
            lost: Future = Future()
            lost.set_exception(error)
            return _Job(number, parameters, lost)

    def end(self) -> None:
        """End the processes, after the runs that they are in."""
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)
            self._executor = None


def _start(task: Task, number: int) -> ProcessPoolExecutor:
    """Start an executor whose processes are all there."""
    executor = ProcessPoolExecutor(number, multiprocessing.get_context("spawn"), _begin, (task,))
    try:
        with one_thread():
            for future in [executor.submit(os.getpid) for _ in range(number)]:
                future.result()
    except BrokenProcessPool:
        raise SceneError(
            "worker processes cannot start", "call simulate_many below the line `if __name__ == '__main__':`, or with processes=1"
        ) from None
    return executor


def _begin(task: Task) -> None:
    """Prepare a worker process; Ctrl-C ends it without a word."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _TASKS.append(task)


def _run(number: int, parameters: Mapping[str, Any]) -> VariedRun:
    """Run a variation in a worker process."""
    return _TASKS[0].run(number, parameters)


def _is_lost(job: _Job) -> bool:
    """Whether a process died before a job was done; waits for its end."""
    return isinstance(job.future.exception(), BrokenProcessPool)


def _result(job: _Job) -> VariedRun:
    """The result of a job that has ended."""
    error = job.future.exception()
    if error is None:
        return job.future.result()
    why = RuntimeError("its process died") if _is_lost(job) else error
    return VariedRun(job.number, job.parameters, error=failure(job.number, why))

"""Who runs takes: this process, a pool of processes, or the workers of a Dask scheduler."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, NamedTuple

from rigidimpulse.core.errors import SceneError
from rigidimpulse.studies.wedges.take import FAILED, Take, TakeJob, run_take

ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
"""Workers share the cores among themselves."""
_SPAWN = multiprocessing.get_context("spawn")
_MARKS: list[Any] = []
"""In a worker process: the marks of the takes that run, in memory that all processes of a pool share."""


class Workers(NamedTuple):
    """Which processes run the takes of a wedge.

    Attributes:
        processes: how many takes at a time; None: one for each core. 1: in the calling process.
        scheduler: address of a Dask scheduler, "tcp://host:port", or "local" for a cluster on this machine; None: no Dask.
        retries: how often a take is run again after an error that is not the scene's, or after its process died.

    """

    processes: int | None = None
    scheduler: str | None = None
    retries: int = 2


ONE_A_CORE = Workers()


def run_here(jobs: Sequence[TakeJob], retries: int) -> Iterator[Take]:
    """Run takes one after the other in this process, each once more after an error, up to `retries` times."""
    for job in jobs:
        for attempt in range(retries + 1):
            try:
                take = run_take(job)
            except Exception as error:
                if attempt < retries:
                    continue
                take = _failed(job, error)
            yield take
            break


def run_pool(jobs: Sequence[TakeJob], processes: int, retries: int) -> Iterator[Take]:
    """Run takes in a pool of processes, in the order they get done, each once more after an error, up to `retries` times.

    When a process dies the pool is lost. Those that ran then are run one by one, so that it is known who dies; then the others go on.
    """
    left = {job.number: job for job in jobs}
    while left:
        marks = _SPAWN.RawArray("b", 1 + max(left))
        try:
            for take in _run_in(processes, list(left.values()), retries, marks):
                del left[take.number]
                yield take
        except BrokenProcessPool:
            for job in [job for job in left.values() if marks[job.number]]:
                del left[job.number]
                yield _run_alone(job, retries)


def _run_in(processes: int, jobs: Sequence[TakeJob], retries: int, marks: Any) -> Iterator[Take]:
    """Run takes in one pool; raises BrokenProcessPool when one of its processes dies. marks: of the takes that run, by their numbers."""
    attempts = dict.fromkeys([job.number for job in jobs], 0)
    with one_thread(), ProcessPoolExecutor(processes, _SPAWN, _begin, (marks,)) as pool:
        waiting: dict[Future, TakeJob] = {pool.submit(_run_marked, job): job for job in jobs}
        while waiting:
            done = wait(waiting, return_when=FIRST_COMPLETED).done
            for future in sorted(done, key=lambda each: waiting[each].number):
                job, error = waiting.pop(future), future.exception()
                if isinstance(error, BrokenProcessPool):
                    raise error
                if error is not None and attempts[job.number] < retries:
                    attempts[job.number] += 1
                    waiting[pool.submit(_run_marked, job)] = job
                else:
                    yield future.result() if error is None else _failed(job, error)


def _run_alone(job: TakeJob, retries: int) -> Take:
    """Run a take in a process of its own, up to `retries` times while that dies."""
    error = BrokenProcessPool()
    for _ in range(retries):
        try:
            return next(_run_in(1, [job], retries, _SPAWN.RawArray("b", 1 + job.number)))
        except BrokenProcessPool as broken:
            error = broken
    return _failed(job, error)


def _begin(marks: Any) -> None:
    """Prepare a worker process."""
    _MARKS.append(marks)


def _run_marked(job: TakeJob) -> Take:
    """Run a take in a worker process; a mark tells that it was running if the process dies."""
    marks = _MARKS[0]
    marks[job.number] = True
    try:
        return run_take(job)
    finally:
        marks[job.number] = False


def run_dask(jobs: Sequence[TakeJob], scheduler: str, processes: int, retries: int) -> Iterator[Take]:
    """Run takes on the workers of a Dask scheduler, or for "local" on a cluster of `processes` on this machine.

    Raises:
        SceneError: Dask is not installed, or there is no scheduler at the address.

    """
    try:
        from distributed import Client, LocalCluster, as_completed
    except ImportError:
        raise SceneError("a scheduler needs the library distributed", "pip install rigidimpulse[dask]") from None
    with one_thread():
        try:
            where: Any = scheduler
            if scheduler == "local":
                where = LocalCluster(processes, threads_per_worker=1, dashboard_address=":0")
            client = Client(where, timeout="10s")
        except (OSError, ValueError) as error:
            raise SceneError(f"no Dask scheduler at {scheduler!r}: {error}", "give tcp://HOST:PORT, or 'local'") from None
    try:
        futures = [client.submit(run_take, job, pure=False, retries=retries) for job in jobs]
        of = {future.key: job for future, job in zip(futures, jobs, strict=True)}
        for future in as_completed(futures):
            error = future.exception()
            yield future.result() if error is None else _failed(of[future.key], error)
    finally:
        client.close()
        if scheduler == "local":
            where.close()


@contextmanager
def one_thread() -> Iterator[None]:
    """Have processes that are started use one thread each."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _failed(job: TakeJob, error: BaseException) -> Take:
    what = "its process died" if isinstance(error, BrokenProcessPool) else f"{type(error).__name__}: {error}"
    return Take(job.number, job.parameters, FAILED, what)

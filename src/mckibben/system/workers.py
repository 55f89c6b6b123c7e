"""Worker processes that start fast and can be ended at once.

joblib's cannot be stopped within a second and load the library each for themselves. These are forked,
where the system can, from a server that has loaded the library. They never run the user's script again,
ignore Ctrl-C, and end with the process that they work for, however that one ends.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future, as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import connection, forkserver, resource_tracker, util
from types import ModuleType
from typing import Any, NoReturn, Self

from mckibben.errors import DataError, MckibbenError
from mckibben.system import threads

PRELOADED = ("mckibben.comparison.ranking", "mckibben.control", "numba", "scipy.optimize")
"""Modules that the server of processes preloads."""

ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""Environment of the server."""

MOST_JOBS = 4096

_start_lock = threading.Lock()

Tell = Callable[..., None]
"""Called by the work to report progress."""

Work = Callable[[Any, Any, Tell], Any]
"""Called with what all calls have in common, the item, and a `Tell`."""


class WorkerError(MckibbenError):
    """A process that did not return a result."""


@dataclass(frozen=True)
class Outcome:
    """The result of one item, or its error.

    Parameters
    ----------
    index : int
        Place of the item among all.
    value : object
        What the work returned.
    error : Exception or None
        What it raised instead.
    """

    index: int
    value: Any = None
    error: Exception | None = None

    def result(self) -> Any:
        """Return the value, or raise the error."""
        if self.error is not None:
            raise self.error
        return self.value


def in_turn(
    work: Work, common: Any, items: Sequence[Any], report: Tell | None = None
) -> Iterator[Outcome]:
    """Do the work in this process, item after item; see `Workers.results`."""
    for index, item in enumerate(items):

        def tell(*progress: Any, index: int = index) -> None:
            if report is not None:
                report(index, *progress)

        tell()
        try:
            yield Outcome(index, work(common, item, tell))
        except Exception as error:
            yield Outcome(index, error=error)


class Workers:
    """Worker processes; leaving the context ends them at once.

    Parameters
    ----------
    n : int
        Processes.
    common : object
        What all calls have in common: sent once to each process.
    cores : int
        Cores that each may use.
    """

    def __init__(self, n: int, common: Any = None, cores: int = 1) -> None:
        self.n, self._common, self._cores = n, common, cores
        self._processes: dict[connection.Connection, Any] = {}

    def __enter__(self) -> Self:
        prepare()
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            process.kill()
        for link in list(self._processes):
            self._end(link)

    def results(
        self, work: Work, items: Sequence[Any], report: Tell | None = None
    ) -> Iterator[Outcome]:
        """Yield the outcome of every item as it finishes; items are started in order.

        Parameters
        ----------
        work : callable
            A function of a module.
        items : sequence
            What to work on.
        report : callable, optional
            Called with an item's index when it is begun, and with its progress.
        """
        waiting = list(enumerate(items))[::-1]
        busy: dict[connection.Connection, int] = {}

        def send_next(link: connection.Connection) -> None:
            busy[link], item = waiting.pop()
            if report is not None:
                report(busy[link])
            with suppress(ConnectionError):  # of one that has died, which is noticed next
                link.send_bytes(pickle.dumps((work, item)))

        while len(self._processes) < min(self.n, len(waiting)):
            self._start()
        for link in list(self._processes)[: len(waiting)]:
            send_next(link)
        while busy:
            ready = set(connection.wait(list(busy)))
            for link in [link for link in busy if link in ready]:
                index = busy[link]
                try:
                    kind, content = pickle.loads(link.recv_bytes())
                except (EOFError, OSError):
                    kind, content = (
                        "error",
                        WorkerError(
                            f"its process ended (exit code {self._end(link)})",
                            remedy="see whether memory is short; use fewer processes: `jobs=1`",
                        ),
                    )
                    del busy[link]
                    link = self._start() if waiting else link
                if kind == "progress":
                    if report is not None:
                        report(index, *content)
                    continue
                if waiting:
                    send_next(link)
                else:
                    busy.pop(link, None)
                yield Outcome(index, **{kind: content})

    def _start(self) -> connection.Connection:
        near_end, far_end = connection.Pipe()
        arguments = (far_end, self._common, self._cores)
        process = context().Process(target=_serve, args=arguments, daemon=False)
        with _without_the_script():
            process.start()
        far_end.close()
        self._processes[near_end] = process
        return near_end

    def _end(self, link: connection.Connection) -> int:
        process = self._processes.pop(link)
        process.join()
        link.close()
        code: int = process.exitcode
        return code


def checked(jobs: int | None) -> int | None:
    """Return a number of processes; raise `DataError` if it is not from 1 to `MOST_JOBS`."""
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        remedy = f"give 1 to {MOST_JOBS}, or leave it out"
        raise DataError(f"it is {jobs}", parameter="jobs", remedy=remedy)
    return jobs


def outcomes(
    work: Work,
    common: Any,
    items: Sequence[Any],
    n: int,
    report: Tell | None = None,
    executor: Executor | None = None,
) -> Iterator[Outcome]:
    """Yield the outcome of every item as it finishes; see `Workers.results`.

    From an executor if there is one, else from n worker processes, or from this one.
    """
    if executor is not None:
        yield from _submitted(executor, work, common, items, report)
    elif min(n, len(items)) <= 1 or multiprocessing.current_process().daemon:  # has no children
        with threads.one_blas_thread():
            yield from in_turn(work, common, items, report)
    else:
        with Workers(min(n, len(items)), common) as workers:
            yield from workers.results(work, items, report)


def _submitted(
    executor: Executor, work: Work, common: Any, items: Sequence[Any], report: Tell | None
) -> Iterator[Outcome]:
    """Yield the outcomes of an executor, which reports no progress within an item."""
    futures: dict[Future[Any], int] = {}
    try:
        for index, item in enumerate(items):
            futures[executor.submit(_alone, work, common, item)] = index
            if report is not None:
                report(index)
        for future in as_completed(futures):
            try:
                outcome = Outcome(futures[future], future.result())
            except (Exception, CancelledError) as error:
                outcome = Outcome(
                    futures[future], error=WorkerError(f"its executor gave {error!r}")
                )
            yield outcome
    finally:
        for future in futures:
            future.cancel()


def _alone(work: Work, common: Any, item: Any) -> Any:
    """Do the work on one item, on one thread."""
    with threads.one_blas_thread():
        return work(common, item, _silent)


def _silent(*progress: Any) -> None:
    """Report nothing."""


def all_of(work: Work, items: Sequence[Any], jobs: int | None = None) -> list[Any]:
    """Return the results of all items, from ``jobs`` processes, by default as many as cores."""
    n = checked(jobs) or threads.cores()
    results = {outcome.index: outcome.result() for outcome in outcomes(work, None, items, n)}
    return [results[index] for index in range(len(items))]


def leave(code: int) -> NoReturn:
    """End this process and its workers at once, without removing temporary folders."""
    with suppress(Exception):
        util._run_finalizers()  # type: ignore[attr-defined]  # typeshed lacks it
    os._exit(code)


def prepare(*more: str) -> None:
    """Start preloading the libraries of workers in the background; call it early.

    ``more`` are modules besides `PRELOADED`.
    """
    if context(*more).get_start_method() != "forkserver":
        return
    with _start_lock:
        resource_tracker.ensure_running()  # which else unblocks signals
        before = {name: os.environ.get(name) for name in ONE_THREAD}
        os.environ.update(ONE_THREAD)
        # blocked signals stay blocked in all that is started: no worker is stopped by Ctrl-C
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            for name, value in before.items():
                os.environ.pop(name, None)
                if value is not None:
                    os.environ[name] = value


def _forget_the_server() -> None:
    """Let a forked process start its own server, as this one's is not its child."""
    forkserver._forkserver._forkserver_pid = None  # type: ignore[attr-defined]  # no public way


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_the_server)


def context(*more: str) -> Any:
    """Return the start method of processes: a preloaded server, or spawning.

    They are spawned where the caller set multiprocessing to that, or the system can do nothing else.
    """
    spawned = multiprocessing.get_start_method(allow_none=True) == "spawn"
    if spawned or "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    server = multiprocessing.get_context("forkserver")
    server.set_forkserver_preload([*PRELOADED, *more])
    return server


def end_with_parent() -> None:
    """End this process when its parent ends."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if not parent.is_alive():
        os._exit(1)

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _serve(link: connection.Connection, common: Any, cores: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    threads.use_cores(cores)
    warnings.simplefilter("ignore")

    def tell(*progress: Any) -> None:
        link.send_bytes(pickle.dumps(("progress", progress)))

    with threads.one_blas_thread(), suppress(EOFError):
        while True:
            link.send_bytes(_answer(link.recv_bytes(), common, tell))


def _answer(message: bytes, common: Any, tell: Tell) -> bytes:
    """Do the work, and return its value or error for sending; unsendable values become errors."""
    try:
        work, item = pickle.loads(message)
        return pickle.dumps(("value", work(common, item, tell)))
    except Exception as error:
        with suppress(Exception):
            answer = pickle.dumps(("error", error))
            reloaded = pickle.loads(answer)[1]
            if type(reloaded) is type(error) and str(reloaded) == str(error):
                return answer
        return pickle.dumps(("error", WorkerError(f"{type(error).__name__}: {error}")))


@contextmanager
def _without_the_script() -> Iterator[None]:
    """Hide the user's script from started processes, which would run it again."""
    with _start_lock:
        script = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = script

"""Processes that work for this one: quick to start, told apart, and ended at once.

joblib's cannot be stopped within a second, do not tell how far they are, and load the library each for
themselves; it serves clusters (`mckibben.comparison.backends`). These are forked, where the system can,
from a server that has loaded the library. They never run the user's script again, do not hear Ctrl-C,
and end with the process that they work for, however that one ends.
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
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import connection, forkserver, resource_tracker, util
from types import ModuleType
from typing import Any, NoReturn, Self

from mckibben.errors import DataError, MckibbenError
from mckibben.system import threads

PRELOADED = ("mckibben.comparison.ranking", "mckibben.control", "numba", "scipy.optimize")
"""What the server loads, so that no process has to."""

ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)

MOST_JOBS = 4096
"""Processes that may be asked for."""

_starting = threading.Lock()

Tell = Callable[..., None]
"""Called by the work with whatever the caller is to be told."""

Work = Callable[[Any, Any, Tell], Any]
"""Called with what all calls have in common, the item, and how to tell."""


class WorkerError(MckibbenError):
    """The process that did the work ended without a word."""


@dataclass(frozen=True)
class Outcome:
    """What came of one item: a value, or an error.

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
    work: Work, common: Any, items: Sequence[Any], told: Callable[..., None] | None = None
) -> Iterator[Outcome]:
    """Do the work in this process, one item after the other; see `Workers.results`."""
    for index, item in enumerate(items):

        def tell(*what: Any, index: int = index) -> None:
            if told is not None:
                told(index, *what)

        tell()
        try:
            yield Outcome(index, work(common, item, tell))
        except Exception as error:
            yield Outcome(index, error=error)


class Workers:
    """A few processes; leaving the context ends them, whatever they are at.

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
        for link, process in self._processes.items():
            process.join()
            link.close()
        self._processes.clear()

    def results(
        self, work: Work, items: Sequence[Any], told: Callable[..., None] | None = None
    ) -> Iterator[Outcome]:
        """Yield what comes of every item, as it comes; items are begun in their order.

        Parameters
        ----------
        work : callable
            A function of a module; called with what is common, the item, and a callable to tell.
        items : sequence
            What to work on.
        told : callable, optional
            Called with an item's index when it is begun, and with what the work tells of it.
        """
        waiting = list(enumerate(items))[::-1]
        busy: dict[connection.Connection, int] = {}

        def begin(link: connection.Connection) -> None:
            index, item = waiting.pop()
            busy[link] = index
            if told is not None:
                told(index)
            with suppress(ConnectionError):  # of one that has died, which is heard of next
                link.send_bytes(pickle.dumps((work, item)))

        while len(self._processes) < min(self.n, len(waiting)):
            self._start()
        for link in list(self._processes)[: len(waiting)]:
            begin(link)
        while busy:
            ready = set(connection.wait(list(busy)))
            for link in [link for link in busy if link in ready]:
                index = busy[link]
                try:
                    kind, what = understood(link.recv_bytes())
                except (EOFError, OSError):
                    kind, what = "raised", self._bury(link)
                    del busy[link]
                    link = self._start() if waiting else link
                if kind == "told":
                    if told is not None:
                        told(index, *what)
                    continue
                if waiting:
                    begin(link)
                else:
                    busy.pop(link, None)
                yield Outcome(index, **{"value" if kind == "done" else "error": what})

    def _start(self) -> connection.Connection:
        ours, theirs = connection.Pipe()
        process = context().Process(
            target=_serve, args=(theirs, self._common, self._cores), daemon=False
        )
        with _without_the_script():
            process.start()
        theirs.close()
        self._processes[ours] = process
        return ours

    def _bury(self, link: connection.Connection) -> WorkerError:
        process = self._processes.pop(link)
        process.join()
        link.close()
        return WorkerError(
            f"its process ended without a word (exit code {process.exitcode})",
            remedy="see whether memory is short; give fewer processes with --jobs",
        )


def checked(jobs: int | None) -> int | None:
    """Return a number of processes that was asked for.

    Raises
    ------
    DataError
        If it is below 1 or above `MOST_JOBS`.
    """
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise DataError(f"jobs is {jobs}", remedy=f"give 1 to {MOST_JOBS}, or leave it out")
    return jobs


def outcomes(
    work: Work,
    common: Any,
    items: Sequence[Any],
    n: int,
    told: Callable[..., None] | None = None,
) -> Iterator[Outcome]:
    """Yield what comes of every item, as it comes, from so many processes, or this one if it is one.

    See `Workers.results`.
    """
    if min(n, len(items)) <= 1 or multiprocessing.current_process().daemon:  # has no children
        with threads.one_blas_thread():
            yield from in_turn(work, common, items, told)
    else:
        with Workers(min(n, len(items)), common) as workers:
            yield from workers.results(work, items, told)


def all_of(work: Work, items: Sequence[Any], jobs: int | None = None) -> list[Any]:
    """Return what comes of every item, in their order; ``jobs`` processes, default as many as cores."""
    n = checked(jobs) or threads.cores()
    found = {outcome.index: outcome.result() for outcome in outcomes(work, None, items, n)}
    return [found[index] for index in range(len(items))]


def leave(code: int) -> NoReturn:
    """End this process at once, whatever it is at; those that work for it end by themselves.

    Temporary folders go, which `os._exit` alone would leave behind.
    """
    with suppress(Exception):
        util._run_finalizers()  # type: ignore[attr-defined]  # typeshed lacks it
    os._exit(code)


def prepare() -> None:
    """Start loading what processes will need, in the background; call it as early as can be."""
    if context().get_start_method() != "forkserver":
        return
    with _starting:
        _prepare()


def _prepare() -> None:
    resource_tracker.ensure_running()  # which else unblocks signals
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    # blocked signals stay blocked in whatever is started: no worker ever hears Ctrl-C
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
    """Let a process forked from this one start a server of its own: this one's is not its child."""
    forkserver._forkserver._forkserver_pid = None  # type: ignore[attr-defined]  # no public way


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_the_server)


def context() -> Any:
    """Return how processes start: from a server that has loaded the library, where there can be one.

    Where the caller set multiprocessing to spawn, or the system knows nothing else, they are spawned.
    """
    spawned = multiprocessing.get_start_method(allow_none=True) == "spawn"
    if spawned or "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    found = multiprocessing.get_context("forkserver")
    found.set_forkserver_preload(list(PRELOADED))
    return found


def end_with_parent() -> None:
    """End this process when the one that started it ends, however it does.

    Where the system can, it does so itself: a thread would wait as long as compiled code keeps all
    others from running.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        import fcntl

        # the parent holds the other end of this pipe, and writes nothing more to it
        fcntl.fcntl(parent.sentinel, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(parent.sentinel, fcntl.F_SETSIG, signal.SIGKILL)
        flags = fcntl.fcntl(parent.sentinel, fcntl.F_GETFL)
        fcntl.fcntl(parent.sentinel, fcntl.F_SETFL, flags | os.O_ASYNC)
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

    with threads.one_blas_thread():
        while True:
            try:
                given = link.recv_bytes()
            except EOFError:
                return
            try:
                work, item = pickle.loads(given)
            except Exception as error:
                link.send_bytes(_packed("raised", _sendable(error)))
                continue
            link.send_bytes(
                answered(work, common, item, lambda *what: link.send_bytes(_packed("told", what)))
            )


def answered(work: Work, common: Any, item: Any, tell: Tell) -> bytes:
    """Do the work, and return what came of it as it is sent: something that arrives, whatever it is."""
    try:
        value = work(common, item, tell)
    except Exception as error:
        return _packed("raised", _sendable(error))
    try:
        return _packed("done", value)
    except Exception as error:
        words = f"what it made, a {type(value).__name__}, cannot be sent: {said(error)}"
        return _packed("raised", WorkerError(words))


def understood(given: object) -> tuple[str, Any]:
    """Return whether something was told, done or raised, and what; what is no answer is an error."""
    if isinstance(given, Exception):
        return "raised", WorkerError(f"the task failed: {said(given)}")
    try:
        kind, what = pickle.loads(given)  # type: ignore[arg-type]  # if it is none, that is told
        if kind == "done" or (kind, type(what)) == ("told", tuple):
            return kind, what
        if kind == "raised" and isinstance(what, Exception):
            return kind, what
        words = "its process gave no answer that is understood"
    except Exception as error:
        words = f"what its process gave cannot be read: {said(error)}"
    return "raised", WorkerError(f"{words}", remedy="use the same versions everywhere")


def _packed(kind: str, what: Any) -> bytes:
    return pickle.dumps((kind, what))


def said(error: Exception) -> str:
    """Return an error in words, whatever its own words do."""
    try:
        return f"{type(error).__name__}: {error}"
    except Exception:
        return type(error).__name__


def _sendable(error: Exception) -> Exception:
    """Return an error that arrives: as it is where it can be made again, else in words."""
    try:
        if type(pickle.loads(pickle.dumps(error))) is type(error):
            str(error)
            return error
    except Exception:
        pass
    return WorkerError(said(error))


@contextmanager
def _without_the_script() -> Iterator[None]:
    """Hide the user's script from processes being started, which else run it again."""
    with _starting:
        script = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = script

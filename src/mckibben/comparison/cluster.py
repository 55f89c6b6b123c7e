"""Comparisons on a Dask cluster, or another backend of joblib: the same tasks, on other machines.

What comes back is unpickled, so a cluster is trusted as this machine is. It may fail all the same:
whatever becomes of its workers, every task has an outcome, and none is waited for that nobody does.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any

from mckibben.errors import DataError
from mckibben.system.extras import demand
from mckibben.system.threads import one_blas_thread
from mckibben.system.workers import Outcome, Work, WorkerError, answered, said, understood

PATIENCE = 30.0
"""How long to wait for a scheduler to answer [s]; it may be busy."""

ABSENCE = 10.0
"""How long to wait for workers where there are none, or none are left [s]."""

BEAT = 0.5
"""How often to see whether there still are workers [s]."""

RETRIES = 3
"""How often a task is given to another worker when its own died."""

_client: ContextVar[Any] = ContextVar("client", default=None)


@contextmanager
def on_cluster(address: str | None) -> Iterator[None]:
    """Fit the models of comparisons within this context on a Dask cluster; without address, here.

    Results are those of a serial run, to the bit. A task whose worker dies is given to another.

    Parameters
    ----------
    address : str or None
        Of the scheduler, such as ``tcp://10.0.0.1:8786``. Its answers are unpickled: name none but your
        own.

    Raises
    ------
    DataError
        If Dask is not installed, the scheduler does not answer, or it has no workers.
    """
    if address is None:
        yield
        return
    demand("distributed", "dask", "clusters of Dask")
    distributed: Any = import_module("distributed")
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise DataError(
            f"no Dask scheduler answers at {address} ({type(error).__name__})",
            remedy="start one with 'dask scheduler', and give its tcp:// address",
        ) from None
    try:
        _await_workers(client, address)
        before = _client.set(client)
        try:
            yield
        finally:
            _client.reset(before)
    finally:
        client.close()


def _await_workers(client: Any, address: str) -> None:
    until = time.monotonic() + ABSENCE
    while not client.nthreads():  # asks the scheduler, and not what the client remembers
        if time.monotonic() > until:
            raise DataError(
                f"the Dask cluster at {address} has no workers",
                remedy="start some with 'dask worker ADDRESS'",
            )
        time.sleep(BEAT)


def outer_backend() -> bool:
    """Tell whether a cluster, or a joblib backend of another kind than its own, was chosen outside."""
    if _client.get() is not None:
        return True
    if "joblib" not in sys.modules:
        return False
    from joblib.parallel import LokyBackend, get_active_backend

    return not isinstance(get_active_backend()[0], LokyBackend)


def processes_outside() -> int:
    """Return how many processes the cluster or the backend that was chosen outside has."""
    client = _client.get()
    if client is not None:
        return max(sum(client.nthreads().values()), 1)
    from joblib.parallel import get_active_backend

    backend, wanted = get_active_backend()
    return int(backend.effective_n_jobs(wanted or -1))


def outcomes_outside(work: Work, common: Any, items: Sequence[Any]) -> Iterator[Outcome]:
    """Yield one outcome for every item, as it comes, from the cluster or backend chosen outside."""
    left = set(range(len(items)))
    client, failure = _client.get(), "no answer came"
    answers = (
        _from_backend(work, common, items)
        if client is None
        else _from_cluster(client, work, common, items)
    )
    try:
        for index, given in answers:
            if index not in left:  # told twice, or of nothing that was asked
                continue
            left.remove(index)
            yield outcome_of(index, given)
    except Exception as error:  # of the backend: what came before is kept
        failure = said(error)
    for index in sorted(left):
        yield Outcome(
            index,
            error=WorkerError(f"{failure}. Remedy: see how the workers are, and call it again."),
        )


def outcome_of(index: int, given: object) -> Outcome:
    """Return what a worker answered."""
    kind, what = understood(given)
    return Outcome(index, value=what) if kind == "done" else Outcome(index, error=what)


def _from_backend(work: Work, common: Any, items: Sequence[Any]) -> Iterator[tuple[int, object]]:
    from joblib import Parallel, delayed
    from joblib.parallel import get_active_backend

    backend = get_active_backend()[0]
    workers = processes_outside()
    way = "generator_unordered" if backend.supports_return_generator else "list"
    pool = Parallel(n_jobs=min(workers, len(items)), return_as=way, max_nbytes=None)
    # what is common is one argument, and the same object: Dask sends it to each worker once
    for answer in pool(delayed(_called)(work, common, i, item) for i, item in enumerate(items)):
        if isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[0], int):
            yield answer


def _from_cluster(
    client: Any, work: Work, common: Any, items: Sequence[Any]
) -> Iterator[tuple[int, object]]:
    # a task of its own, which is done again where the worker that held its result has died
    shared = client.submit(_same, common, pure=False)
    futures = {
        client.submit(_called, work, shared, i, item, pure=False, retries=RETRIES, priority=-i): i
        for i, item in enumerate(items)
    }
    done: SimpleQueue[Any] = SimpleQueue()
    for future in futures:
        future.add_done_callback(done.put)
    try:
        seen = time.monotonic()
        while futures:
            try:
                future = done.get(timeout=BEAT)
            except Empty:
                if _has_workers(client):
                    seen = time.monotonic()
                elif time.monotonic() - seen > ABSENCE:
                    raise WorkerError("the cluster has no workers any more") from None
                continue
            if future in futures:
                index = futures.pop(future)
                yield index, _result(future, index)
    finally:
        with suppress(Exception):  # of a scheduler that is gone
            client.cancel([shared, *futures])


def _has_workers(client: Any) -> bool:
    try:
        return client.status == "running" and bool(client.nthreads())
    except Exception:  # of a scheduler that is gone
        return False


def _result(future: Any, index: int) -> object:
    """Return a task's answer, or the error that the cluster has instead."""
    try:
        answer = future.result(timeout=PATIENCE)
    except Exception as error:
        return error
    return answer[1] if isinstance(answer, tuple) and answer[:1] == (index,) else answer


def _same(common: Any) -> Any:
    return common


def _called(work: Work, common: Any, index: int, item: Any) -> tuple[int, bytes]:
    with one_blas_thread():
        return index, answered(work, common, item, lambda *_: None)

"""Comparisons on an external joblib backend, such as a Dask cluster.

What comes back is unpickled, so a cluster is trusted as this machine is.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any

from mckibben.errors import DataError
from mckibben.system.extras import demand
from mckibben.system.threads import one_blas_thread
from mckibben.system.workers import Outcome, Work, WorkerError, answered, said, understood

PATIENCE = 30.0
"""How long to wait for a scheduler to answer, and for its first worker [s]."""


@contextmanager
def on_cluster(address: str | None) -> Iterator[None]:
    """Fit the models of comparisons within this context on a Dask cluster; locally without address.

    Results are those of a serial run, to the bit.

    Parameters
    ----------
    address : str or None
        Of the scheduler, such as ``tcp://10.0.0.1:8786``: name none but your own.

    Raises
    ------
    DataError
        If Dask is not installed, or no scheduler with workers answers.
    """
    if address is None:
        yield
        return
    demand("distributed", "dask", "clusters of Dask")
    distributed: Any = import_module("distributed")
    from joblib import parallel_config

    with ExitStack() as stack:
        try:
            client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
            stack.enter_context(client).wait_for_workers(1, timeout=PATIENCE)
        except (OSError, ValueError, TypeError) as error:  # a time-out among them
            raise DataError(
                f"no Dask scheduler with workers answers at {address} ({type(error).__name__})",
                remedy="start 'dask scheduler' and 'dask worker ADDRESS', and give its tcp:// address",
            ) from None
        with parallel_config("dask", client=client):
            yield


def chosen() -> bool:
    """Return whether an external joblib backend is selected."""
    if "joblib" not in sys.modules:
        return False
    from joblib.parallel import LokyBackend, get_active_backend

    return not isinstance(get_active_backend()[0], LokyBackend)


def processes() -> int:
    """Return the number of processes of the selected backend."""
    from joblib.parallel import get_active_backend

    backend, wanted = get_active_backend()
    return int(backend.effective_n_jobs(wanted or -1))


def outcomes(work: Work, common: Any, items: Sequence[Any]) -> Iterator[Outcome]:
    """Yield one outcome per item as it finishes, also if workers fail."""
    from joblib import Parallel, delayed
    from joblib.parallel import get_active_backend

    backend = get_active_backend()[0]
    way = "generator_unordered" if backend.supports_return_generator else "list"
    pool = Parallel(n_jobs=min(processes(), len(items)), return_as=way, max_nbytes=None)
    left, failure = set(range(len(items))), "no answer came"
    try:
        # what is common is one argument, and the same object: Dask sends it to each worker once
        for index, answer in pool(
            delayed(_called)(work, common, *each) for each in enumerate(items)
        ):
            left.remove(index)
            kind, what = understood(answer)
            yield Outcome(index, **{kind: what})
    except Exception as error:  # of the backend: what came before is kept
        failure = said(error)
    for index in sorted(left):
        remedy = "see how the workers are, and call it again"
        yield Outcome(index, error=WorkerError(failure, remedy=remedy))


def _called(work: Work, common: Any, index: int, item: Any) -> tuple[int, bytes]:
    with one_blas_thread():
        return index, answered(work, common, item, lambda *_: None)

"""Comparisons on a Dask cluster: the same tasks, on other machines."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from mckibben.errors import DataError
from mckibben.threads import one_blas_thread
from mckibben.workers import Outcome, Work

PATIENCE = 10
"""How long to wait for the scheduler to answer [s]."""

RETRIES = 3
"""How often a task is given to another worker when its own died."""


@contextmanager
def on_cluster(address: str | None) -> Iterator[None]:
    """Fit the models of comparisons within this context on a Dask cluster; without address, here.

    Results are those of a serial run, to the bit. A task whose worker dies is given to another.

    Parameters
    ----------
    address : str or None
        Of the scheduler, such as ``tcp://10.0.0.1:8786``.

    Raises
    ------
    DataError
        If Dask is not installed, the scheduler does not answer, or it has no workers.
    """
    if address is None:
        yield
        return
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise DataError(
            "Dask is not installed", remedy="install it: pip install 'mckibben[dask]'"
        ) from None
    from joblib import parallel_config

    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise DataError(
            f"no Dask scheduler answers at {address} ({type(error).__name__})",
            remedy="start one with 'dask scheduler', and give its tcp:// address",
        ) from None
    try:
        if not client.scheduler_info(n_workers=-1)["workers"]:
            raise DataError(
                f"the Dask cluster at {address} has no workers",
                remedy="start some with 'dask worker ADDRESS'",
            )
        with client.as_current(), parallel_config("dask", client=client, retries=RETRIES):
            yield
    finally:
        client.close()


def outer_backend() -> bool:
    """Tell whether a joblib backend of another kind than its own processes was chosen outside."""
    if "joblib" not in sys.modules:
        return False
    from joblib.parallel import LokyBackend, get_active_backend

    return not isinstance(get_active_backend()[0], LokyBackend)


def processes_outside() -> int:
    """Return how many processes the joblib backend that was chosen outside has."""
    from joblib.parallel import get_active_backend

    backend, wanted = get_active_backend()
    return int(backend.effective_n_jobs(wanted or -1))


def in_backend(work: Work, common: Any, items: Sequence[Any]) -> Iterator[Outcome]:
    """Yield what comes of every item on the joblib backend that was chosen outside."""
    from joblib import Parallel, delayed
    from joblib.parallel import get_active_backend

    backend = get_active_backend()[0]
    workers = processes_outside()
    way = "generator_unordered" if backend.supports_return_generator else "list"
    pool = Parallel(n_jobs=min(workers, len(items)), return_as=way, max_nbytes=None)
    # what is common is one argument, and the same object: Dask sends it to each worker once
    yield from pool(delayed(_called)(work, common, i, item) for i, item in enumerate(items))


def _called(work: Work, common: Any, index: int, item: Any) -> Outcome:
    with one_blas_thread():
        return Outcome(index, work(common, item, lambda *_: None))

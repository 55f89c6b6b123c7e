"""Comparisons on a Dask cluster: the same tasks, on other machines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from mckibben.errors import DataError

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

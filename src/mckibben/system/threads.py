"""Number of cores used by a call.

Matrices here are small: linear algebra on all cores takes longer than on one, and much longer while
other processes run. It has one thread; cores are for models, folds and starts.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager

_lock = threading.Lock()
_inside = 0
_limits = ExitStack()
_cores: int | None = None


def cores() -> int:
    """Return the number of cores that this process may use."""
    if _cores is not None:
        return _cores
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def use_cores(n: int) -> None:
    """Set the number of cores of this process."""
    global _cores
    _cores = n


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit linear algebra to one thread, in the whole process, until the last context exits."""
    global _inside
    with _lock:
        if _inside == 0:
            import scipy.linalg  # noqa: F401  # limits hold for what is loaded, and it has its own BLAS
            from threadpoolctl import threadpool_limits

            _limits.enter_context(threadpool_limits(1, user_api="blas"))
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _limits.close()


def on_all_cores(call: Callable[[int], None], count: int) -> None:
    """Call a function with 0, 1, ... count - 1, on all cores at once."""
    workers = min(cores(), count)

    def every(first: int) -> None:
        for index in range(first, count, workers):
            call(index)

    if workers == 1:
        every(0)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(every, range(workers)))

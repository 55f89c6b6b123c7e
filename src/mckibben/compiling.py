"""Functions that numba compiles when they are first run, so that importing them does not load it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial, update_wrapper
from pickle import UnpicklingError
from typing import Any, TypeVar, cast

from mckibben.caches import place

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS = {"nogil": True, "error_model": "numpy"}
_lock = threading.Lock()


class Deferred:
    """A function that becomes numba's when it is first called, from Python or from another one.

    Parameters
    ----------
    function : callable
        What to compile.
    options : dict
        Of `numba.njit`.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self.targetoptions = options  # under the name where numba looks for ``inline``
        self._dispatcher: Callable[..., Any] | None = None

    @property
    def dispatcher(self) -> Callable[..., Any]:
        """Numba's function, or the plain one where compiling is disabled."""
        if self._dispatcher is None:
            import numba

            with _lock:  # one of them, however many threads ask
                if self._dispatcher is None:
                    compiled = numba.njit(**self.targetoptions)(self.py_func)
                    _keep(compiled, self.py_func)
                    self._dispatcher = compiled
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        """What numba asks for where a compiled function calls this one."""
        return self.dispatcher._numba_type_  # type: ignore[attr-defined]

    def __call__(self, *arguments: Any) -> Any:
        """Run it, compiled."""
        return self.dispatcher(*arguments)


def deferred(function: Function, **options: Any) -> Function:
    """Compile a function when it is first called, with exact arithmetic if not told otherwise.

    Parameters
    ----------
    function : callable
        Of what numba compiles without Python objects.
    **options
        Of `numba.njit`, beside freedom of other threads, and division as NumPy does it.
    """
    return cast("Function", Deferred(function, _OPTIONS | options))


def _keep(compiled: Any, function: Callable[..., Any]) -> None:
    """Let numba keep a function compiled in a folder of this user's alone, if there is one."""
    import numba

    config: Any = numba.config
    if config.DISABLE_JIT:
        return
    folder = place()
    if folder is None:
        return
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        # as its own ``enable_caching`` does
        compiled._cache = _cache_class()(function)
    except RuntimeError:  # it has no source that could be seen to change
        pass
    finally:
        config.CACHE_DIR = before


@cache
def _cache_class() -> Any:
    """Return numba's cache, done without where it fails, as on a full disk."""
    from numba.core.caching import FunctionCache

    base: Any = FunctionCache

    class Cache(base):  # type: ignore[misc]  # numba has no types
        def save_overload(self, *what: Any) -> None:
            with suppress(OSError):
                base.save_overload(self, *what)

        def load_overload(self, *what: Any) -> Any:
            with suppress(OSError, EOFError, UnpicklingError):
                return base.load_overload(self, *what)

    return Cache


def resolved(function: Function) -> Function:
    """Return numba's own function, which is called without the detour, for calls sample by sample."""
    return cast("Function", function.dispatcher) if isinstance(function, Deferred) else function


_entries: dict[tuple[Any, ...], Callable[..., None]] = {}


def bound(function: Callable[..., None], *arrays: Any) -> Callable[[], None]:
    """Return a call with these arrays; of one sample, their types are looked at now, not every time.

    The last array has a row, or number, for every sample.
    """
    run = resolved(function)
    if len(arrays[-1]) > 1 or not hasattr(run, "compile"):  # which a plain function has not
        return partial(run, *arrays)
    key = (run, *[(a.dtype, a.ndim, a.flags.num) for a in arrays])
    if key not in _entries:
        import numba

        _entries[key] = run.compile(tuple(map(numba.typeof, arrays)))
    return partial(_entries[key], *arrays)


def in_turn(*runs: Callable[[], None]) -> Callable[[], None]:
    """Return one call of several."""

    def run() -> None:
        for each in runs:
            each()

    return run

"""Functions that numba compiles when they are first run, so that importing them does not load it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import update_wrapper
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}
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
                    try:
                        self._dispatcher = numba.njit(**self.targetoptions)(self.py_func)
                    except RuntimeError:
                        # there is nowhere to keep what is compiled: it is compiled each time
                        uncached = self.targetoptions | {"cache": False}
                        self._dispatcher = numba.njit(**uncached)(self.py_func)
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
        Of `numba.njit`, beside caching, freedom of other threads, and division as NumPy does it.
    """
    return cast("Function", Deferred(function, _OPTIONS | options))


def resolved(function: Function) -> Function:
    """Return numba's own function, which is called without the detour, for calls sample by sample."""
    return cast("Function", function.dispatcher) if isinstance(function, Deferred) else function

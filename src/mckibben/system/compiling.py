"""Functions compiled by numba at their first call, so that imports do not load it.

What is compiled is cached for the next process, in the user's cache folder by version of the package, or
in ``NUMBA_CACHE_DIR``. A compiled function holds those that it calls, wherever they are, and the numbers
that it reads by name, so that its file is named after all of them. A file that is damaged is made anew.
"""

from __future__ import annotations

import os
import pickle
import re
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, partial, update_wrapper
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar, cast

import numpy as np

from mckibben.errors import CacheWarning, DataError
from mckibben.system.atomic import replacing
from mckibben.version import __version__

Function = TypeVar("Function", bound=Callable[..., Any])

DIGEST = sha256().digest_size
"""Bytes before the compiled code, by which a damaged file is detected."""

_OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""No entry for C: it would hold all the code again, and nothing calls it."""

_lock = threading.Lock()
"""Held while a function is compiled."""


@cache
def cache_folder() -> Path | None:
    """Return the folder for compiled functions, or None if it cannot be written to."""
    from platformdirs import user_cache_path

    given = os.environ.get("NUMBA_CACHE_DIR")
    base = Path(given).absolute() / "mckibben" if given else user_cache_path("mckibben")
    folder = base / __version__
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        _note(f"compiled functions are not cached: {folder} cannot be written to")
        return None
    return folder


@cache
def _note(text: str) -> None:
    """Warn once of a problem with the cache."""
    warnings.warn(text, CacheWarning, stacklevel=2)


class Deferred:
    """A function compiled at its first call, from Python or from another compiled function."""

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
                    config: Any = numba.config
                    self._dispatcher = self.py_func if config.DISABLE_JIT else self._compiled()
        return self._dispatcher

    def _compiled(self) -> Callable[..., Any]:
        import numba

        digest = made_of(self)  # once: it looks at all that is called
        compiled = numba.njit(**self.targetoptions)(_with_digest(self.py_func, digest))
        _compile_alike(compiled)
        if folder := cache_folder():
            compiled._cache = _Cache(folder, self.py_func.__qualname__, digest)
        return cast("Callable[..., Any]", compiled)

    @property
    def _numba_type_(self) -> Any:
        """Return the type that numba requests when a compiled function calls this one."""
        return self.dispatcher._numba_type_  # type: ignore[attr-defined]

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to find it in another process, and its digest for numba's cache.

        One that another function made stays in its process.
        """
        module, name = self.py_func.__module__, self.py_func.__qualname__
        attribute = getattr(import_module(module), name, None)
        if attribute is self:
            return _named, (module, name, made_of(self))
        if attribute is self.py_func:
            return _again, (attribute, self.targetoptions, made_of(self))
        return str, (made_of(self),)

    def __call__(self, *arguments: Any) -> Any:
        """Run it, compiled."""
        return self.dispatcher(*arguments)


def _named(module: str, name: str, _: str) -> Any:
    """Return what a module has of a name: a pickled function."""
    return getattr(import_module(module), name)


def _again(function: Callable[..., Any], options: dict[str, Any], _: str) -> Deferred:
    """Return a pickled function that its module has uncompiled."""
    return Deferred(function, options)


def deferred(function: Function, **options: Any) -> Function:
    """Compile a function at its first call, by default with exact arithmetic.

    ``options`` are those of `numba.njit`; other threads run meanwhile, and division is as NumPy's.
    """
    return cast("Function", Deferred(function, _OPTIONS | options))


def _with_digest(function: Any, digest: str) -> Callable[..., Any]:
    """Return a function with a digest of its content in its name.

    Numba calls compiled code by name. Two functions of one name, such as those that one function makes,
    would be mixed up if they come from files that two processes wrote.
    """
    code, names, closure = function.__code__, function.__globals__, function.__closure__
    copy = FunctionType(code, names, function.__name__, function.__defaults__, closure)
    update_wrapper(copy, function)
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__qualname__ = f"{function.__qualname__}_{digest[:32]}"
    return copy


def _compile_alike(compiled: Any) -> None:
    """Compile a function once for constants and variables of one type, for all callers."""
    from numba.core import types

    unliteral: Any = types.unliteral
    template = compiled.get_call_template

    def alike(args: Any, kws: Any) -> Any:
        return template([*map(unliteral, args)], {name: unliteral(kws[name]) for name in kws})

    compiled.get_call_template = alike


class _Cache:
    """Cache of compiled functions: a file per signature, named after a digest of the content.

    So processes that write at the same time do not mix functions up. Numba's own cache shares one file
    among functions of one name, such as kernels made by one function.

    ``digest`` is that of `made_of`.
    """

    def __init__(self, folder: Path, name: str, digest: str) -> None:
        self.cache_path = str(folder)
        self._stem = folder / re.sub(r"[^\w.]", "", name)
        self._digest = digest

    def _file(self, signature: Any, codegen: Any) -> Path:
        import numba

        versions = numba.__version__, sys.version, codegen.magic_tuple()
        digest = sha256(repr((self._digest, str(signature), versions)).encode()).hexdigest()
        return self._stem.with_name(f"{self._stem.name}-{digest[:40]}.nbc")

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the compiled code of a signature; None if it is missing or damaged."""
        from numba.core import compiler

        result: Any = compiler.CompileResult
        target_context.refresh()
        try:
            content = self._file(signature, target_context.codegen()).read_bytes()
            if sha256(content[DIGEST:]).digest() != content[:DIGEST]:
                raise ValueError
            return result._rebuild(target_context, *pickle.loads(content[DIGEST:]))
        except (FileNotFoundError, ImportError):  # of what it calls, which was elsewhere
            return None
        except Exception:  # it is compiled again
            _note("compiled functions in the cache were damaged, and are compiled again")
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Write the compiled code of a signature; failures, such as a full disk, are ignored."""
        from numba.core import serialize

        dumps: Any = serialize.dumps
        if compiled.lifted or compiled.library.has_dynamic_globals:
            return
        payload = dumps(compiled._reduce())
        file = self._file(signature, compiled.codegen)
        with suppress(DataError, OSError), replacing(file) as new:
            new.write_bytes(sha256(payload).digest() + payload)


def made_of(function: Deferred) -> str:
    """Return a digest of a function, its callees, and the constants they use."""
    digest = sha256()
    for part in _parts(function, {}):
        digest.update(part.encode() + b"\n")
    return digest.hexdigest()


def _parts(value: Any, seen: dict[int, int]) -> Iterator[str]:
    """Yield the parts that distinguish a value for compiled code."""
    if isinstance(value, Deferred):
        new = id(value) not in seen
        yield f"function {seen.setdefault(id(value), len(seen))}"
        if new:
            function = value.py_func
            yield from _parts(tuple(value.targetoptions.items()), seen)
            yield from _parts(function.__defaults__, seen)
            yield from _parts(tuple((function.__kwdefaults__ or {}).items()), seen)
            yield from _parts(
                tuple(cell.cell_contents for cell in function.__closure__ or ()), seen
            )
            yield from _code_parts(function.__code__, function.__globals__, seen)
    elif isinstance(value, np.ndarray):  # numba freezes what it holds
        yield f"{value.dtype.str}{value.shape}"
        yield value.tobytes().hex()
    elif isinstance(value, np.generic):
        yield repr(value)
    elif isinstance(value, tuple):
        for item in value:
            yield from _parts(item, seen)
    elif isinstance(value, set | frozenset):
        yield repr(sorted(map(repr, value)))
    elif isinstance(value, bool | int | float | complex | str | bytes):
        yield repr(value)


def _code_parts(code: CodeType, names: dict[str, Any], numbers: dict[int, int]) -> Iterator[str]:
    """Yield the parts of a function's code: instructions, constants, and what its names refer to.

    ``known`` are the names of its module; a name may be a member of any module that it reaches.
    """
    yield code.co_code.hex()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code_parts(constant, names, numbers)
        else:
            yield from _parts(constant, numbers)
    modules: list[ModuleType] = []
    reached = [names]
    while reached:  # a.b.f: modules in modules
        members = reached.pop()
        deeper = [members[n] for n in code.co_names if isinstance(members.get(n), ModuleType)]
        reached += [vars(module) for module in deeper if module not in modules]
        modules += deeper
    for name in code.co_names:
        yield name
        for members in (names, *map(vars, modules)):
            yield from _parts(members.get(name), numbers)


def resolved(function: Function) -> Function:
    """Return numba's function itself, for calls sample by sample without overhead."""
    return cast("Function", function.dispatcher) if isinstance(function, Deferred) else function


_entries: dict[tuple[Any, ...], Callable[..., None]] = {}
"""Compiled code by function and types of its arguments."""


def bound(function: Callable[..., None], *arrays: Any) -> Callable[[], None]:
    """Return a call with these arrays; the types for a single sample are resolved only once.

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
    """Return one call of several in sequence."""

    def run() -> None:
        for each in runs:
            each()

    return run

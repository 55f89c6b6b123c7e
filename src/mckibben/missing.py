"""What a block still lacks of all that those of the package have, from its registry line to its C."""

from __future__ import annotations

import inspect
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Literal

import numpy as np

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Composition
from mckibben.blocks.equations import quantities, undeclared
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.laws.check import LAWS
from mckibben.blocks.laws.trial import Trial
from mckibben.comparison.limits import limits
from mckibben.errors import MckibbenError, ModelError
from mckibben.export import export_c
from mckibben.export.c.building import self_test
from mckibben.export.c.wiring import Wiring
from mckibben.export.programs import own_compiler
from mckibben.system.compiling import Deferred
from mckibben.system.ordinary import read_text

SAMPLE_TIME = 0.01
MOST_TEXT = 10_000_000

State = Literal["there", "none", "missing"]


@dataclass(frozen=True)
class Finding:
    """One thing that blocks have.

    Parameters
    ----------
    what : str
        The thing.
    state : {"there", "none", "missing"}
        ``none`` where a block may well do without.
    said : str
        What was found, or what to do.
    """

    what: str
    state: State
    said: str


def missing(name: str) -> list[Finding]:
    """Look for all that a block should have.

    Parameters
    ----------
    name : str
        A kind of the registry, or ``package.module:Class``.

    Returns
    -------
    list of Finding
        Also of what is there. Code is compiled and run where there is a C compiler.

    Raises
    ------
    ModelError
        If there is no such block, or it makes no example.
    """
    cls = _block_class(name)
    found = [_registered(cls)]
    with _registered_meanwhile(cls):
        try:
            block = cls.example()
        except Exception as error:
            raise ModelError(
                f"{cls.__name__} makes no example: {error}. Remedy: return a small one of it."
            ) from error
        found += _laws(block)
        found += [look(block) for look in LOOKS]
    return found


def _block_class(name: str) -> type[Block]:
    module, _, attribute = name.partition(":")
    if not attribute:
        return registry.load("blocks", name)
    try:
        found = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, SyntaxError, ValueError) as error:
        raise ModelError(
            f"{name!r} cannot be imported: {error}. Remedy: give package.module:Class, from the folder "
            "that the package is in."
        ) from error
    if not (inspect.isclass(found) and issubclass(found, Block)):
        raise ModelError(f"{name!r} is no block. Remedy: derive it from mckibben.Block.")
    absent = sorted(getattr(found, "__abstractmethods__", ()))
    absent += [field for field in ("kind",) if not hasattr(found, field)]
    if absent:
        raise ModelError(f"{name!r} has no {', '.join(absent)}. Remedy: define what blocks define.")
    return found


def _location(cls: type[Block]) -> str:
    return f"{cls.__module__}:{cls.__qualname__}"


def _registered(cls: type[Block]) -> Finding:
    what = "registry line"
    if cls.kind not in registry.names("blocks"):
        line = f'"{cls.kind}": "{_location(cls)}"'
        return Finding(what, "missing", f"in registry.py, or as an entry point: {line}")
    if registry.load("blocks", cls.kind) is not cls:
        return Finding(what, "missing", f"another block is called {cls.kind!r}: rename this one")
    return Finding(what, "there", f"{cls.kind!r}")


@contextmanager
def _registered_meanwhile(cls: type[Block]) -> Iterator[None]:
    """Let a block be saved and loaded that has no registry line yet."""
    known = registry.PLUGINS["blocks"]
    absent = cls.kind not in registry.names("blocks")
    if absent:
        known[cls.kind] = _location(cls)
        registry._locations.cache_clear()
    try:
        yield
    finally:
        if absent:
            del known[cls.kind]
            registry._locations.cache_clear()


def _tried(what: str, attempt: Callable[[], str]) -> Finding:
    """Return what an attempt says, or why it fails."""
    try:
        return Finding(what, "there", attempt())
    except MckibbenError as error:
        return Finding(what, "missing", str(error))
    except Exception as error:
        return Finding(what, "missing", f"{type(error).__name__}: {error}")


def _laws(block: Block) -> Iterator[Finding]:
    trials: list[Trial] = []

    def told(law: Callable[[Trial], None]) -> str:
        if not trials:
            trials.append(Trial.of(block, SAMPLE_TIME, 0))
        law(trials[0])
        return ""

    for law in LAWS:
        name = law.__name__.strip("_").replace("_", " ")
        yield _tried(f"law: it {name}", partial(told, law))


def _inverse(block: Block) -> Finding:
    try:
        inverse = block.inverse()
    except ModelError as error:
        return Finding("inverse", "none", str(error))
    return Finding("inverse", "there", f"{inverse.title!r}")


def _parameters(block: Block) -> Finding:
    if block.n_parameters:
        return Finding("pack and unpack", "there", ", ".join(block.parameter_names))
    return Finding("pack and unpack", "none", "name the fields to be found in `parameters`")


def _c(block: Block) -> Finding:
    """Export the block, and what undoes it, in both precisions; compile and run them if that can be."""
    directions = [block, block.inverse()] if isinstance(block, Invertible) else [block]

    def told() -> str:
        for direction in directions:
            for single in (False, True):
                _export(direction, single)
        return "gives Python's numbers" if own_compiler() else "not run: there is no C compiler"

    return _tried("C", told)


def _export(block: Block, single: bool) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "c"
        step = SAMPLE_TIME if block.rate_dependent else None
        export_c(block, folder, name="tried", sample_time=step, single=single)
        if own_compiler():
            self_test(folder, "tried")


def _cost(block: Block) -> Finding:
    def told() -> str:
        cost = Wiring(block, SAMPLE_TIME).cost
        own = type(block).cost is not Block.cost or isinstance(block, Composition)
        said = "" if own else ": one pass over its numbers, for `cost` says no other"
        return f"{cost.usual} of a step, {cost.worst} at worst{said}"

    return _tried("operation counts", told)


def _single(block: Block) -> Finding:
    """Look for fields that happen to increase, as knots do, and that nothing keeps apart."""
    what = "limits of single precision"
    named = {name for name, _ in block.kept_apart()}
    for field in fields(block):  # type: ignore[arg-type]
        value = getattr(block, field.name)
        rising = isinstance(value, tuple) and len(value) > 2 and _is_rising(value)
        if rising and field.name not in {*named, *block.parameters, "limits"}:
            said = f"{field.name} increases: name it in `increasing` if single precision must keep that"
            return Finding(what, "missing", said)
    return Finding(what, "there", ", ".join(sorted(named)) or "no numbers to keep apart")


def _is_rising(values: tuple[object, ...]) -> bool:
    """Tell whether values are numbers that increase."""
    return all(isinstance(v, float) for v in values) and bool(np.all(np.diff(values) > 0))  # type: ignore[arg-type]


def _estimators(block: Block) -> Finding:
    """Look for estimators whose files name the class, and for what the pages say of them."""
    what, found = "estimator", []
    for name in registry.names("estimators"):
        cls = inspect.unwrap(registry.load("estimators", name))
        if any(value is type(block) for value in vars(sys.modules[cls.__module__]).values()):
            found.append(name)
    if not found:
        return Finding(what, "none", "nothing finds its parameters: see docs/templates")
    silent = [name for name in found if name not in limits()]
    if silent:
        return Finding(what, "missing", f"of {silent[0]}, a sentence in comparison/limits.toml")
    return Finding(what, "there", ", ".join(found))


def _documented(block: Block) -> Finding:
    text = " ".join(cls.__doc__ or "" for cls in type(block).__mro__)
    absent = [f.name for f in fields(block) if not re.search(rf"\b{f.name}\b", text)]  # type: ignore[arg-type]
    module = sys.modules[type(block).__module__].__doc__
    if absent or not module:
        said = (
            f"{', '.join(absent)} in the docstring" if absent else "what is modelled, atop the file"
        )
        return Finding("documentation", "missing", said)
    return Finding("documentation", "there", module.strip().splitlines()[0])


def _notation(block: Block) -> Finding:
    """Look for equations, and for a unit of every number."""
    what = "equations and units"
    silent = undeclared(block)
    if not block.equations() or silent:
        said = "equations" if not block.equations() else f"the unit of {', '.join(silent)}"
        return Finding(what, "missing", f"{said}, in `notation`")
    return Finding(what, "there", f"{len(block.equations())} and {len(quantities(block))}")


def _tests(block: Block) -> Finding:
    """Look for the plain loop of the kernel, in the tests of the folder that this is run in."""
    twins = Path("tests", "twins.py")
    if not twins.is_file():
        return Finding("tests", "none", f"not looked for: there is no {twins} here")
    kernel = isinstance(getattr(block, "kernel", None), Deferred)
    if kernel and f'"{block.kind}"' not in read_text(twins, most=MOST_TEXT):
        return Finding("tests", "missing", f"a plain loop of each kernel, in {twins}")
    return Finding(
        "tests", "there", "the laws, and the plain loop of its kernel" if kernel else "the laws"
    )


LOOKS = (_inverse, _parameters, _c, _cost, _single, _estimators, _documented, _notation, _tests)

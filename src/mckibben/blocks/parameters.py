"""Base classes that validate fields and have a parameter vector of fixed structure."""

from __future__ import annotations

from abc import ABCMeta
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import wraps
from inspect import isfunction
from itertools import islice
from operator import attrgetter
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ValidationError

from mckibben.arrays import Array
from mckibben.blocks.notation import declared, indexed, symbols
from mckibben.errors import ModelError

Made = TypeVar("Made")

UNCOMPUTABLE = (ArithmeticError, np.linalg.LinAlgError)
COMPUTING = {"coefficients", "initial_state", "inverse", "passes", "reachable"}
"""Methods in which numbers may overflow or underflow, such as constructors."""


def _computing(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method whose arithmetic errors are raised as model errors."""

    @wraps(method)
    def guarded(self: Any, *given: Any, **named: Any) -> Any:
        try:
            return method(self, *given, **named)
        except UNCOMPUTABLE as error:
            raise _beyond_sense(type(self), error) from error

    return guarded


def _beyond_sense(cls: type, error: Exception) -> ModelError:
    return ModelError(
        f"the numbers of {getattr(cls, 'kind', cls.__name__)!r} cannot be computed with ({error})",
        remedy="identify the model again; values of this size are not meaningful",
    )


class Checked(ABCMeta):
    """What makes classes that refuse bad fields, and numbers beyond all sense, with a `ModelError`."""

    def __new__(
        mcs, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **named: Any
    ) -> Checked:
        """Return the class with guarded arithmetic."""
        for method in COMPUTING & namespace.keys():
            if isfunction(namespace[method]):
                namespace[method] = _computing(namespace[method])
        return super().__new__(mcs, name, bases, namespace, **named)

    def __call__(cls: type[Made], /, *values: Any, **named: Any) -> Made:
        """Return an instance, its fields validated."""
        try:
            made: Made = super().__call__(*values, **named)  # type: ignore[misc]
            if isinstance(made, Parametrised):
                _check_declared(made)
            return made
        except UNCOMPUTABLE as error:
            raise _beyond_sense(cls, error) from error
        except ValidationError as error:
            first = error.errors()[0]
            names = [field.name for field in fields(cls) if not field.kw_only]  # type: ignore[arg-type]
            field, *inside = first["loc"]
            if isinstance(field, int):
                field = names[field] if field < len(names) else f"argument {field + 1}"
            where = ".".join(str(step) for step in (field, *inside))
            kind = getattr(cls, "kind", cls.__name__)
            given = "" if first["type"] == "missing" else f", but it is {first['input']!r:.60}"
            raise ModelError(
                f"of {kind!r}: {first['msg']}{given}",
                parameter=where,
                remedy=f"give what {cls.__name__} documents",
            ) from None


def _check_declared(part: Parametrised) -> None:
    """Raise an error for fields that do not increase, or have not as many entries, as declared."""
    for name in part.increasing:
        if np.any(np.diff(getattr(part, name)) <= 0):
            raise ModelError(
                f"those of {part.kind!r} do not increase",
                parameter=name,
                remedy="sort them and drop repeated ones",
            )
    sizes = {name: len(getattr(part, name)) for name in part.same_length}
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{size} {name}" for name, size in sizes.items())
        raise ModelError(
            f"{part.kind!r} has {listed}",
            parameter=min(sizes, key=sizes.__getitem__),
            remedy="give as many of each",
        )


class Parametrised(metaclass=Checked):
    """An object with a parameter vector, by default made of its fields.

    A field may be a number, a vector, rows, a part that has parameters itself, several of those, or
    None.
    """

    kind: ClassVar[str]
    """Name in the registry and in saved files."""

    parameters: ClassVar[tuple[str, ...]] = ()
    """Names of the fields, in the order of the vector."""

    increasing: ClassVar[tuple[str, ...]] = ()
    """Fields that must be strictly increasing, also after rounding to single precision."""

    same_length: ClassVar[tuple[str, ...]] = ()
    """Fields of which each has as many entries."""

    formulas: ClassVar[tuple[str, ...]] = ()
    """Its equations, in LaTeX; symbols are declared with the fields, see `mckibben.blocks.notation`."""

    def equations(self) -> tuple[str, ...]:
        """Return the equations of this structure, in LaTeX; by default those of its class."""
        return self.formulas

    def unit_of(self, field: str, index: tuple[int, ...]) -> str | None:
        """Return the unit of a number of a field, as `Symbol` writes it; None if none is declared."""
        del index
        return declared(type(self), field).unit

    def name_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the label of a parameter: the field's name, and its indices."""
        return " ".join([field.replace("_", " "), *(str(k + 1) for k in index)])

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number of a field in the equations, in LaTeX, with its indices."""
        symbol = declared(type(self), field)
        return indexed(symbol.letter, index, symbol.first)

    def letter_of(self, field: str, place: int) -> str:
        """Return the letter of a channel of a field in the equations; empty if none is declared."""
        del place
        return symbols(type(self))[field].letter if field in symbols(type(self)) else ""

    @property
    def n_parameters(self) -> int:
        """Length of the parameter vector, `pack`."""
        return self.pack().size

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Label of each entry of `pack`; see `name_of`."""
        names: list[str] = []
        for field in self.parameters:
            for index, leaf in leaves(getattr(self, field)):
                part = isinstance(leaf, Parametrised)
                names += leaf.parameter_names if part else [self.name_of(field, index)]
        return tuple(names or (f"{self.kind} {k + 1}" for k in range(self.n_parameters)))

    def numbers(self) -> Iterator[tuple[Parametrised, str, tuple[int, ...]]]:
        """Yield part, field and indices of every entry of `pack`, in order."""
        for field in self.parameters:
            for index, leaf in leaves(getattr(self, field)):
                if isinstance(leaf, Parametrised):
                    yield from leaf.numbers()
                else:
                    yield self, field, index

    def pack(self) -> Array:
        """Return the parameters as a vector, shape (n_parameters,)."""
        return gathered(self, self.parameters)

    def unpack(self, parameters: ArrayLike) -> Self:
        """Return the same structure with other parameters, shape (n_parameters,).

        Raises
        ------
        ModelError
            If they are more or fewer.
        """
        values = iter(parameter_vector(self, parameters).tolist())
        fields = {name: _refilled(getattr(self, name), values) for name in self.parameters}
        return replace(self, **fields)  # type: ignore[type-var]


def plain(part: Any) -> Any:
    """Return a block, or a value in one, as JSON-ready values."""
    if is_dataclass(part) and not isinstance(part, type):
        head = {"kind": part.kind} if hasattr(part, "kind") else {}
        members = sorted(
            fields(part), key=lambda field: bool(field.kw_only)
        )  # those of a base come last
        return head | {field.name: plain(getattr(part, field.name)) for field in members}
    if isinstance(part, tuple):
        return [plain(item) for item in part]
    return part


def with_parts(value: Any, change: Callable[[Any], Any]) -> Any:
    """Return a value with every part in it, inner ones first, replaced by ``change(part)``."""
    if isinstance(value, tuple):
        items = tuple(with_parts(item, change) for item in value)
        return value if all(a is b for a, b in zip(items, value, strict=True)) else items
    if not (isinstance(value, Parametrised) and is_dataclass(value)):
        return value
    now = {field.name: getattr(value, field.name) for field in fields(value)}
    new = {name: with_parts(item, change) for name, item in now.items()}
    changed = {name: item for name, item in new.items() if item is not now[name]}
    return change(replace(value, **changed) if changed else value)


def same_as(path: str) -> Any:
    """Return a property that refers to an attribute of a part: ``"part.attribute"``."""
    return property(attrgetter(path), doc=f"``{path}``")


def gathered(part: Parametrised, names: Iterable[str]) -> Array:
    """Return the values of attributes in one vector."""
    numbers: list[float] = []
    for name in names:
        _gather(getattr(part, name), numbers)
    return np.array(numbers, dtype=np.float64)


def parameter_vector(part: Parametrised, parameters: ArrayLike) -> Array:
    """Return a parameter vector after checking its length."""
    vector = np.asarray(parameters, dtype=np.float64)
    if vector.shape != (part.n_parameters,):
        raise ModelError(
            f"{part.kind!r} of this structure has {part.n_parameters} parameters, got "
            f"shape {vector.shape}",
            remedy="give a vector as pack() returns it",
        )
    return vector


def _gather(value: Any, numbers: list[float]) -> None:
    if isinstance(value, float | int):
        numbers.append(value)
    elif type(value) is not tuple:
        numbers.extend(() if value is None else value.pack().tolist())
    elif _is_flat(value):
        numbers.extend(value)
    else:
        for item in value:
            _gather(item, numbers)


def _refilled(value: Any, numbers: Iterator[float]) -> Any:
    if type(value) is float:
        return next(numbers)
    if type(value) is not tuple:
        return value and value.unpack(tuple(islice(numbers, value.n_parameters)))
    if _is_flat(value):
        return tuple(islice(numbers, len(value)))
    return tuple(_refilled(item, numbers) for item in value)


def _is_flat(values: tuple[Any, ...]) -> bool:
    return not values or type(values[0]) is float


def leaves(value: Any, index: tuple[int, ...] = ()) -> Iterator[tuple[tuple[int, ...], Any]]:
    """Yield the numbers and parts of a field, each with its indices."""
    if isinstance(value, tuple):
        for k, item in enumerate(value):
            yield from leaves(item, (*index, k))
    elif isinstance(value, float | Parametrised):
        yield index, value


def one_per(field: str, more: int = 0, *, times: int = 1) -> Any:
    """Return a property: the number of entries of a field, ``times`` that, plus ``more``."""
    return property(lambda part: times * len(getattr(part, field)) + more)

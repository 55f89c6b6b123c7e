"""Identified muscles as readable TOML files, one per muscle."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.saving import part_from_dict
from mckibben.errors import DataError, ModelError
from mckibben.muscles.sheet import Sheet
from mckibben.muscles.traits import GROUPS, PLACES, traits
from mckibben.system.ordinary import DESCRIPTION, named_toml, read_text
from mckibben.system.validation import invalid

FORMAT, VERSION = "mckibben-muscle", 1

FOLDER = Path(__file__).parent / "library"

UNSURE = 0.5
"""Standard error of a trait's logarithm above which its recordings do not determine it."""


class Conditions(BaseModel):
    """Conditions of a muscle's identification: lowest and highest of each."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    pressure_bar: tuple[float, float]
    displacement_mm: tuple[float, float]
    force_N: tuple[float, float] | None = None  # noqa: N815
    fastest_mm_per_s: float = Field(ge=0)
    seconds: float = Field(gt=0)
    rmse: float = Field(ge=0)


class _File(BaseModel):
    """A file of the library."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: str
    version: int
    title: str
    source: str
    licence: str
    virtual: bool
    sheet: Sheet
    conditions: Conditions
    uncertainty: dict[str, tuple[Annotated[float, Field(ge=0)], ...]]
    balance: dict[str, Any]

    @field_validator("uncertainty")
    @classmethod
    def _is_whole(cls, groups: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
        if {name: len(values) for name, values in groups.items()} != GROUPS:
            expected = ", ".join(f"{name} ({count})" for name, count in GROUPS.items())
            raise ValueError(f"it has to hold {expected}")
        return groups


@dataclass(frozen=True)
class Muscle:
    """An identified muscle.

    Parameters
    ----------
    name : str
    title, source, licence : str
        What it is, where its recordings come from, and what may be done with these numbers.
    virtual : bool
        Whether it is a virtual rig's.
    sheet : Sheet
    conditions : Conditions
    balance : Balance
        As fitted.
    errors : array
        Standard errors of its traits (`mckibben.muscles.traits`); NaN of undetermined ones.
    """

    name: str
    title: str
    source: str
    licence: str
    virtual: bool
    sheet: Sheet
    conditions: Conditions
    balance: Balance
    errors: Array

    def summary(self) -> dict[str, Any]:
        """Return its description and its data sheet, for JSON."""
        fields_ = {key: getattr(self, key) for key in ("title", "virtual", "source", "licence")}
        return fields_ | {"sheet": self.sheet.model_dump(exclude_none=True)}

    def to_dict(self) -> dict[str, Any]:
        """Return it with its conditions and its balance, for JSON."""
        conditions = self.conditions.model_dump(exclude_none=True)
        about = {"name": self.name} | self.summary()
        return about | {"conditions": conditions, "balance": self.balance.to_dict()}

    @property
    def traits(self) -> Array:
        """Traits determined by its recordings, others NaN."""
        result = traits(self.balance, self.sheet)
        return np.where(self.errors < UNSURE, result, np.nan)


@cache
def names() -> tuple[str, ...]:
    """Return the names of the muscles of the package, in alphabetical order."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def list() -> tuple[Muscle, ...]:  # noqa: A001
    """Return the muscles of the package, by name.

    >>> import mckibben
    >>> "mas20-hanging" in [muscle.name for muscle in mckibben.muscles.list()]
    True
    """
    return tuple(load(name) for name in names())


def load(name: str | Path) -> Muscle:
    """Return an identified muscle, by its name or from a file.

    Raises
    ------
    DataError
        On an unknown name, or a file that is no identified muscle.
    """
    path = named_toml(name, FOLDER, "muscle")
    return _own(path) if path.parent == FOLDER else _load(path)


@cache
def _own(path: Path) -> Muscle:
    return _load(path)


def _load(path: Path) -> Muscle:
    content = parsed(path)
    if content.get("format") != FORMAT or content.get("version") != VERSION:
        raise DataError(
            f'it is no identified muscle (format = "{FORMAT}", version = {VERSION})',
            file=path,
            remedy=f"give a muscle's file, or one of {', '.join(names())}",
        )
    try:
        file = _File.model_validate(content)
        balance = part_from_dict(file.balance | {"kind": Balance.kind})
    except ValidationError as error:
        raise invalid(error, path, "correct it, as files of the library have it") from None
    except ModelError as error:
        remedy = error.remedy or "correct it"
        where = "balance" if error.parameter is None else f"balance.{error.parameter}"
        raise DataError(error.problem, file=path, parameter=where, remedy=remedy) from None
    assert isinstance(balance, Balance)
    errors = np.concatenate([np.array(file.uncertainty[name], dtype=np.float64) for name in GROUPS])
    fields = file.model_dump(include={"title", "source", "licence", "virtual"})
    muscle = Muscle(path.stem, **fields, sheet=file.sheet, conditions=file.conditions,
                    balance=balance, errors=errors)  # fmt: skip
    try:
        sound = bool(np.isfinite(muscle.traits[errors < UNSURE]).all())
    except (ArithmeticError, LookupError):
        sound = False
    if not sound:
        raise DataError(
            "its balance is that of no muscle of this data sheet",
            file=path,
            remedy="correct [balance], or [sheet]",
        )
    return muscle


def parsed(path: Path) -> dict[str, Any]:
    """Return the contents of a TOML file.

    Raises
    ------
    DataError
        If it cannot be read, or is no TOML.
    """
    text = read_text(path, most=DESCRIPTION).removeprefix("\ufeff")
    try:
        return tomllib.loads(text)
    except (RecursionError, ValueError) as error:
        raise DataError(f"it is no TOML: {error}", file=path, remedy="correct it there") from None


def described(muscle: Muscle) -> str:
    """Return a muscle as the text of its file."""
    block = muscle.balance.to_dict()
    channels = {"driven", "scheduled", "given"}
    known_keys = {"format", "version", "kind", "pressure_range", *channels}
    known_keys |= {
        each.name for each in fields(Balance) if getattr(muscle.balance, each.name) == each.default
    }
    text = [f'format = "{FORMAT}"', f"version = {VERSION}"]
    text += [f"{name} = {_toml(getattr(muscle, name))}" for name in ("title", "source", "licence")]
    text += [f"virtual = {_toml(muscle.virtual)}", "", "[sheet]"]
    text += _pairs(muscle.sheet.model_dump(exclude_none=True))
    text += ["", "[conditions]", *_pairs(muscle.conditions.model_dump(exclude_none=True))]
    text += ["", "[uncertainty]  # standard errors of the logarithms of its traits; inf: unknown"]
    text += [f"{name} = {_toml(muscle.errors[index].tolist())}" for name, index in PLACES.items()]
    text += ["", "[balance]", *_pairs({k: v for k, v in block.items() if k not in known_keys})]
    text += _pairs({k: block[k] for k in block if k in channels})
    return "\n".join(text) + "\n"


def _pairs(content: dict[str, Any]) -> list[str]:  # type: ignore[valid-type]
    return [f"{name} = {_toml(value)}" for name, value in content.items()]


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, tuple | type([])):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)

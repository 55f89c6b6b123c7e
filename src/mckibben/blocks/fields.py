"""Fields of blocks: validated numbers, channels and start states, stored as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Interval, MaxLen, MinLen
from numpy.typing import ArrayLike
from pydantic import AfterValidator, BeforeValidator, ConfigDict, FiniteFloat
from pydantic.dataclasses import dataclass as validated_dataclass

from mckibben.arrays import NARROWEST, Array
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording

Rule = Literal["first_sample", "virgin"]
"""Name of a start state: at rest at the first input, or as if nothing had ever happened.

As the field of a block the first is used where no measured output determines another start, see
`mckibben.blocks.starts`; as an argument of `simulate` it is used as stated.
"""

Initial = Rule | Sequence[float] | Array
"""State before the first sample."""


def plain_sequence(values: Any) -> Any:
    """Convert a list or an array to a tuple; return other values unchanged."""
    values = values.tolist() if isinstance(values, np.ndarray) else values
    return tuple(values) if isinstance(values, list) else values


MOST_NUMBERS, MOST_COEFFICIENTS = 1_000_000, 1000
"""Maximum number of entries of a field, and of coefficients of a polynomial, whose roots are
computed.
"""

Vector = Annotated[tuple[FiniteFloat, ...], MaxLen(MOST_NUMBERS), BeforeValidator(plain_sequence)]
"""Finite numbers; arrays and lists are converted to a tuple."""

Coefficients = Annotated[
    tuple[FiniteFloat, ...], MaxLen(MOST_COEFFICIENTS), BeforeValidator(plain_sequence)
]
"""Coefficients of a polynomial."""

PolynomialField = Annotated[Coefficients, MinLen(1)]
"""Ascending coefficients of a polynomial, at least one."""


def rows(value: Any) -> Any:
    """Return a table of numbers as the value of a field."""
    listed = plain_sequence(value)
    return tuple(map(plain_sequence, listed)) if isinstance(listed, tuple) else listed


Rows = Annotated[tuple[Vector, ...], BeforeValidator(rows)]
"""Rows of finite numbers."""

Substeps = Annotated[int, Interval(ge=1, le=10_000)]
"""Steps of integration from sample to sample."""

Hold = Literal["first", "zero"]
"""Input between samples: in a straight line, or held."""

LONGEST_DELAY = 254
"""Largest delay of an output [samples]."""

Positive = Annotated[FiniteFloat, Gt(0)]
NotNegative = Annotated[FiniteFloat, Ge(0)]

PositiveVector = Annotated[
    tuple[Positive, ...], MaxLen(MOST_NUMBERS), BeforeValidator(plain_sequence)
]
NotNegativeVector = Annotated[
    tuple[NotNegative, ...], MaxLen(MOST_NUMBERS), BeforeValidator(plain_sequence)
]
Thresholds = Annotated[NotNegativeVector, MinLen(1)]
"""Thresholds of operators, at least one."""

Knots = Annotated[Vector, MinLen(2)]
"""Places between which a function is straight."""

PositiveRows = Annotated[tuple[PositiveVector, ...], BeforeValidator(rows)]

Scale = tuple[FiniteFloat, Positive]
"""Centre and half range of a quantity."""

NARROWEST_SHARE = 1e-9
"""Smallest width of an input range, relative to the magnitude of its ends."""


def wide(ends: tuple[float, float]) -> tuple[float, float]:
    """Raise an error for an input range that is empty or too narrow to resolve."""
    low, high = ends
    width = high - low
    if NARROWEST <= width < np.inf and width >= NARROWEST_SHARE * (abs(low) + abs(high)):
        return ends
    raise ModelError(
        f"{ends} is empty, or too narrow or wide to compute with",
        parameter="input_range",
        remedy="give (lowest, highest)",
    )


InputRange = Annotated[tuple[FiniteFloat, FiniteFloat], AfterValidator(wide)]
"""Lowest and highest input of an inverse."""


def _retired_start(value: Any) -> Any:
    """Return the start of a file of version 0.1 by today's name."""
    return "first_sample" if value == "fitted" else plain_sequence(value)


StoredInitial = Annotated[Rule | Vector, BeforeValidator(_retired_start)]
"""`Initial` as a field of a block."""

StartRule = Annotated[Rule, BeforeValidator(_retired_start)]
"""Start of a block that has only named ones."""


def vector(values: ArrayLike) -> tuple[float, ...]:
    """Return numbers as the value of a field."""
    return tuple(np.asarray(values, dtype=np.float64).tolist())


STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, validate_default=True)
"""How blocks validate their fields: no unknown ones, no silent conversion, nothing infinite.

Defaults are validated too: a field without one takes the attribute of that name of a base class, as
``sample_time = None`` of `Block`, which must not pass for a value.
"""


@validated_dataclass(frozen=True, config=STRICT)
class Channel:
    """Name and unit of an input or output.

    Parameters
    ----------
    name : str
        As recordings call it.
    unit : str
        Of the package: bar, mm, N, s, rad and their kin; empty for none.
    """

    name: str
    unit: str


COMMANDS = ("pressure", "voltage")
"""Names of channels that drive a muscle."""


def drives(channel: Channel) -> bool:
    """Return whether a channel drives a muscle, by its name or unit."""
    return channel.name.startswith(COMMANDS) or channel.unit in ("bar", "V")


def check_units(recording: Recording, channels: Sequence[Channel]) -> None:
    """Raise an error if a channel of a model is missing in a recording, or has another unit."""
    for channel in channels:
        recording[channel.name]  # refuses what is absent
        if (unit := recording.units[channel.name]) != channel.unit:
            raise DataError(
                f"the model has it in {channel.unit or 'no unit'}, the recording in "
                f"{unit or 'no unit'}",
                file=recording.source,
                channel=channel.name,
                remedy=f"convert the recording, or read it with `units[{channel.name}]=UNIT`",
            )


def _channel(value: Any) -> Any:
    return Channel(**value) if isinstance(value, dict) else value


ChannelField = Annotated[Channel, BeforeValidator(_channel)]
"""A channel as a field of a block."""


def _channels(values: Any) -> Any:
    values = plain_sequence(values)
    return tuple(map(_channel, values)) if isinstance(values, tuple) else values


Channels = Annotated[tuple[Channel, ...], BeforeValidator(_channels)]
"""Several channels as a field of a block."""

PRESSURE = Channel("pressure", "bar")
DISPLACEMENT = Channel("displacement", "mm")
FORCE = Channel("force", "N")
LENGTH = Channel("length", "mm")
CONTRACTION = Channel("contraction", "")


@validated_dataclass(frozen=True, kw_only=True, repr=False, config=STRICT)
class WithMemory:
    """Fields of a block of one input and one output that has memory.

    Parameters
    ----------
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample.
    input, output : Channel
        Channel driven and channel given.
    """

    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

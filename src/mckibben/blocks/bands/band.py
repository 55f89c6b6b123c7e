"""A band round a modelled output: shifted and scaled by the state of motion, as wide as a level asks.

    lower = min(y, y + m(z) - q s(z) w),   upper = max(y, y + m(z) + q s(z) w),

where y is modelled, z is what `mckibben.blocks.bands.state_of_motion` sees, m what the model misses on
average there, log s how much it misses, both sums of weights times z and times bells round places in z;
q what the level asks for, and w = 1, or more beyond the ranges
that calibration saw. How m, s and q are found is told in `mckibben.bands`.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.bands.state_of_motion import look
from mckibben.blocks.base import Block, Kernel, Start, needs_sample_time
from mckibben.blocks.fields import STRICT, Channel, Channels, Rows, Vector
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError
from mckibben.numerals import numeral

WIDENS = 0.05
"""Share of a range beyond its end at which a band is twice as wide."""

FARTHEST = 3.0
"""Deviations from the mean beyond which what is seen counts as just there."""

HEAD = 6


@step
def band_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Give, for every modelled output, its value, its lower and its upper end."""
    c = coefficients
    n_driving, n_given = int(c[0]), int(c[1])
    n_widths, n_keeps, n_bells, sharpness = int(c[2]), int(c[3]), int(c[4]), c[5]
    n_x = n_driving + n_given
    n_seen = n_x + n_driving * (n_widths + n_keeps)
    n_terms = 1 + n_seen + n_bells
    at = HEAD
    ends = c[at : at + 2 * n_x]
    at += 2 * n_x
    widths = c[at : at + n_widths]
    at += n_widths
    keeps = c[at : at + n_keeps]
    at += n_keeps
    mean = c[at : at + n_seen]
    at += n_seen
    spread = c[at : at + n_seen]
    at += n_seen
    bells = c[at : at + n_bells * n_seen]
    at += n_bells * n_seen
    shift = c[at : at + n_given * n_terms]
    at += n_given * n_terms
    log_scale = c[at : at + n_given * n_terms]
    at += n_given * n_terms
    limits = c[at : at + 4 * n_given]
    at += 4 * n_given
    quantile = c[at : at + n_given]
    seen, terms = scratch[:n_seen], scratch[n_seen : n_seen + n_terms]
    beyond = look(inputs, ends, widths, keeps, n_driving, state, seen)
    terms[0] = 1.0
    for i in range(n_seen):
        far = (seen[i] - mean[i]) / spread[i]
        terms[1 + i] = min(max(far, -FARTHEST), FARTHEST)
    for k in range(n_bells):
        distance = 0.0
        for i in range(n_seen):
            off = terms[1 + i] - bells[k * n_seen + i]
            distance += off * off
        terms[1 + n_seen + k] = np.exp(-sharpness * distance)
    for g in range(n_given):
        m, s = 0.0, 0.0
        for i in range(n_terms):
            m += shift[g * n_terms + i] * terms[i]
            s += log_scale[g * n_terms + i] * terms[i]
        m = min(max(m, limits[4 * g]), limits[4 * g + 1])
        s = np.exp(min(max(s, limits[4 * g + 2]), limits[4 * g + 3]))
        half = quantile[g] * s * (1.0 + beyond / WIDENS)
        value = inputs[n_driving + g]
        outputs[3 * g] = value
        outputs[3 * g + 1] = min(value, value + m - half)
        outputs[3 * g + 2] = max(value, value + m + half)


@kernel
def band_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start plays and lags at rest at the first sample."""
    c = coefficients
    n_driving, n_x, per = int(c[0]), int(c[0]) + int(c[1]), int(c[2]) + int(c[3])
    for j in range(n_driving):
        low, high = c[HEAD + j], c[HEAD + n_x + j]
        share = min(max((inputs[j] - low) / (high - low), 0.0), 1.0)
        state[j * per : (j + 1) * per] = share


@dataclass(frozen=True, config=STRICT)
class Band(Block):
    """From a model's inputs and outputs to its outputs with their lower and upper ends.

    Parameters
    ----------
    driving : tuple of Channel
        The model's inputs.
    given : tuple of Channel
        Its outputs.
    ends : rows, shape (2, inputs and outputs)
        Lowest and highest of each that calibration saw.
    widths : vector
        Of plays, as shares of a range.
    times : vector
        Time constants of lags [s]; with some the band is rate-dependent.
    mean, spread : vector, shape (s,)
        Of what is seen of the motion.
    bells : rows, shape (b, s)
        Places of bells, in deviations from the mean.
    sharpness : float
        Of the bells, per squared deviation.
    shift, log_scale : rows, shape (outputs, 1 + s + b)
        Weights of the constant, of what is seen, and of the bells: of what the model misses on average
        in the output's unit, and of the logarithm of how much.
    limits : rows, shape (outputs, 4)
        Least and largest shift, least and largest logarithm of the scale.
    scores : rows, shape (outputs, any)
        What the half width is in scales, at evenly spaced levels from 0 to 1.
    units : int
        How many exchangeable runs, or blocks of runs, calibration had.
    unit : {"run", "block"}
        Which of them.
    level : float
        Share of samples of a new run that the band is to hold, between 0 and units / (units + 1).
    memory : float
        How long misses stay alike, the integral of their autocorrelation [s], or in samples where there
        are no ``times``; 0 where it is not known. The band does not depend on it; what is drawn from it
        does (`mckibben.control.Twin`).
    """

    kind: ClassVar[str] = "band"
    kernel: ClassVar[Kernel] = band_step
    start_kernel: ClassVar[Start] = band_start
    parameters: ClassVar[tuple[str, ...]] = ("shift", "log_scale")
    notation: ClassVar[Notation] = Notation(
        r"y^{\pm} = \begin{cases} \max(y,\, y + m + q s w) \\ \min(y,\, y + m - q s w) \end{cases}",
        r"m = M \cdot (1,\, z,\, \beta(z)),\quad \ln s = S \cdot (1,\, z,\, \beta(z))",
        shift="M_{jk} [{out0}]",
        log_scale="S_{jk}",
    )

    driving: Channels
    given: Channels
    ends: Rows
    widths: Vector
    times: Vector
    mean: Vector
    spread: Vector
    bells: Rows
    sharpness: float
    shift: Rows
    log_scale: Rows
    limits: Rows
    scores: Rows
    units: Annotated[int, Field(ge=1)]
    unit: Literal["run", "block"] = "run"
    level: float = 0.9
    memory: Annotated[FiniteFloat, Field(ge=0)] = 0.0

    def __post_init__(self) -> None:
        n_x, n_seen, n_given = len(self.driving) + len(self.given), self._n_seen, len(self.given)
        terms = 1 + n_seen + len(self.bells)
        fits = {
            "ends": [n_x] * 2,
            "bells": [n_seen] * len(self.bells),
            "shift": [terms] * n_given,
            "log_scale": [terms] * n_given,
            "limits": [4] * n_given,
            "scores": [max(len(self.scores[0]) if self.scores else 0, 2)] * n_given,
        }
        for name, wanted in fits.items():
            if [len(row) for row in getattr(self, name)] != wanted:
                raise ModelError(f"the {name} of a band do not fit. Remedy: calibrate again.")
        if len(self.mean) != n_seen or len(self.spread) != n_seen or not self.driving:
            raise ModelError("the state of a band does not fit. Remedy: calibrate again.")
        positive = (*self.widths, *self.times, *self.spread, self.sharpness)
        if min(positive, default=1.0) <= 0 or any(a >= b for a, b in zip(*self.ends, strict=True)):
            raise ModelError(
                "a width, time, spread, sharpness or range of a band is not positive. "
                "Remedy: calibrate again."
            )
        if any(list(row) != sorted(row) or row[0] < 0 for row in self.scores):
            raise ModelError("the scores of a band do not rise. Remedy: calibrate again.")
        if any(a > b or c > d for a, b, c, d in self.limits):
            raise ModelError("the limits of a band are not in order. Remedy: calibrate again.")
        check_level(self.level, self.units, self.unit)

    @property
    def _n_seen(self) -> int:
        n = len(self.driving)
        return n + len(self.given) + n * (len(self.widths) + len(self.times))

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether it looks at lags."""
        return bool(self.times)

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """The model's inputs, then its outputs."""
        return (*self.driving, *self.given)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Of every output of the model, itself, then its lower and its upper end."""
        return tuple(
            Channel(f"{channel.name}{end}", channel.unit)
            for channel in self.given
            for end in ("", "_lower", "_upper")
        )

    @property
    def n_states(self) -> int:
        """Plays and lags of every input."""
        return len(self.driving) * (len(self.widths) + len(self.times))

    @property
    def n_scratch(self) -> int:
        """What is seen, and terms."""
        return 1 + 2 * self._n_seen + len(self.bells)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the numbers that the kernel reads, at this level."""
        step = needs_sample_time(self.kind, sample_time) if self.times else 1.0
        keeps = np.exp(-step / np.array(self.times))
        places = [int(np.ceil(self.level * (len(row) - 1) - 1e-9)) for row in self.scores]
        head = [len(self.driving), len(self.given), len(self.widths), len(self.times)]
        return np.concatenate(
            [
                np.array([*head, len(self.bells), self.sharpness], dtype=np.float64),
                np.ravel(self.ends),
                np.array(self.widths),
                keeps,
                np.array(self.mean),
                np.array(self.spread),
                np.ravel(self.bells),
                np.ravel(self.shift),
                np.ravel(self.log_scale),
                np.ravel(self.limits),
                [row[place] for row, place in zip(self.scores, places, strict=True)],
            ]
        )

    @classmethod
    def example(cls) -> Self:
        """Return a band of a displacement by pressure that is wider where the pressure just turned."""
        return cls(
            driving=(Channel("pressure", "bar"),),
            given=(Channel("displacement", "mm"),),
            ends=((0.0, -1.0), (6.0, 40.0)),
            widths=(0.1,),
            times=(2.0,),
            mean=(0.5, 0.0, 0.0, 0.5),
            spread=(0.3, 0.5, 0.2, 0.3),
            bells=((0.0, -1.0, 0.5, 0.0),),
            sharpness=0.25,
            shift=((0.0, 0.1, 0.05, -0.1, 0.0, 0.2),),
            log_scale=((-1.0, 0.2, 0.1, 0.3, 0.0, 0.4),),
            limits=((-0.5, 0.5, -3.0, 1.0),),
            scores=((0.0, 0.5, 1.0, 1.5, 2.0, 4.0),),
            units=19,
        )


def check_level(level: float, units: int, unit: str) -> None:
    """Refuse a level that is none, or that so few exchangeable units do not allow.

    A new one is as likely as each of them to be missed most, and nothing bounds by how much.

    Raises
    ------
    ModelError
        Naming the highest level there is, and how many units the one asked for needs.
    """
    if not 0.0 < level < 1.0:
        raise ModelError(f"the level is {level:g}. Remedy: give one above 0 and below 1, as 0.9.")
    if level > units / (units + 1) + 1e-12:
        most, needed = (
            numeral(100 * units / (units + 1), 3),
            int(np.ceil(level / (1.0 - level) - 1e-9)),
        )
        raise ModelError(
            f"a band calibrated on {units} {unit}(s) holds at most {most} %, and "
            f"{numeral(100 * level, 4)} % are asked for. Remedy: ask for less, or calibrate on at least "
            f"{needed} {unit}s."
        )

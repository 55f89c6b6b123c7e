"""Bands: how far off a model may be, by the state of motion, and models that come with one.

    lower = min(y, y + m(z) - q s(z) w),   upper = max(y, y + m(z) + q s(z) w),

where y is modelled, z is the state of motion, m what the model misses on average there, log s how much
it misses, both linear in z; q is what a level asks for, and w = 1, or more beyond the ranges that
calibration saw. `mckibben.bands` finds m, s and q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Ports, Start, needs_sample_time
from mckibben.blocks.compose import Composition, Layout
from mckibben.blocks.fields import STRICT, Channel, Channels, Initial, Rows, Vector
from mckibben.blocks.kernels import Step, kernel, step
from mckibben.blocks.notation import Notation
from mckibben.blocks.parameters import same_as
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError
from mckibben.numerals import numeral
from mckibben.registry import load

WIDENS = 0.05
"""Share of a range beyond its end at which a band is twice as wide."""

FARTHEST = 3.0
"""Deviations from the mean beyond which what is seen counts as just there."""

HEAD = 6


@kernel
def rest(first: Array, ends: Array, n_driving: int, per: int, state: Array) -> None:
    """Fill the state of a motion that begins at rest; ``per`` are plays and lags of an input."""
    for j in range(n_driving):
        low, high = ends[j], ends[ends.size // 2 + j]
        share = min(max((first[j] - low) / (high - low), 0.0), 1.0)
        state[j * per : (j + 1) * per] = share


@kernel
def look(
    x: Array, ends: Array, widths: Array, keeps: Array, n_driving: int, state: Array, seen: Array
) -> float:
    """Take one sample, fill the state of motion, and return how far it is beyond what was seen.

    Every input, scaled to the range that calibration saw, gives its level, how far it is from its last
    reversals (plays of several widths, over their widths: 1 where the play is drawn along, less where
    the input just turned), and how far it is from its own past (lags of several times). Every modelled
    output gives its level.

    ``x`` are ``n_driving`` inputs, then modelled outputs, of the lowest, then highest ``ends``;
    ``widths`` are of plays, as shares of the range, and ``keeps`` what lags keep of themselves from
    sample to sample. The state has plays and lags of every input. How far a sample is beyond an end is
    a share of that channel's range, the largest of all.
    """
    beyond, place, slot = 0.0, 0, 0
    for j in range(x.size):
        low, high = ends[j], ends[x.size + j]
        share = (x[j] - low) / (high - low)
        beyond = max(beyond, share - 1.0, -share)
        share = min(max(share, 0.0), 1.0)
        seen[place] = share
        place += 1
        if j >= n_driving:
            continue
        for i in range(widths.size):
            at = min(max(state[slot], share - widths[i]), share + widths[i])
            state[slot] = at
            seen[place] = (share - at) / widths[i]
            slot += 1
            place += 1
        for i in range(keeps.size):
            at = share + keeps[i] * (state[slot] - share)
            state[slot] = at
            seen[place] = share - at
            slot += 1
            place += 1
    return beyond


@kernel
def look_along(
    samples: Array, ends: Array, widths: Array, keeps: Array, state: Array, found: Array
) -> None:
    """Fill ``found``, shape (n, states of motion), over a run that begins at rest.

    ``state`` is room for plays and lags of all inputs that drive.
    """
    per = widths.size + keeps.size
    n_driving = state.size // per
    rest(samples[0], ends, n_driving, per, state)
    for t in range(samples.shape[0]):
        look(samples[t], ends, widths, keeps, n_driving, state, found[t])


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
    at_widths = HEAD + 2 * n_x
    at_mean = at_widths + n_widths + n_keeps
    at_bells = at_mean + 2 * n_seen
    at_weights = at_bells + n_bells * n_seen
    at_limits = at_weights + 2 * n_given * n_terms
    ends, widths = c[HEAD:at_widths], c[at_widths : at_widths + n_widths]
    keeps = c[at_widths + n_widths : at_mean]
    mean, spread = c[at_mean : at_mean + n_seen], c[at_mean + n_seen : at_bells]
    bells, weights = c[at_bells:at_weights], c[at_weights:at_limits]
    limits, quantile = c[at_limits : at_limits + 4 * n_given], c[at_limits + 4 * n_given :]
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
            m += weights[g * n_terms + i] * terms[i]
            s += weights[(n_given + g) * n_terms + i] * terms[i]
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
    n_driving, n_x = int(c[0]), int(c[0]) + int(c[1])
    rest(inputs, c[HEAD : HEAD + 2 * n_x], n_driving, int(c[2]) + int(c[3]), state)


@dataclass(frozen=True, config=STRICT)
class Band(Block):
    """From a model's inputs and outputs to its outputs with their lower and upper ends.

    Parameters
    ----------
    driving, given : tuple of Channel
        The model's inputs, and its outputs.
    ends : rows, shape (2, inputs and outputs)
        Lowest and highest of each that calibration saw.
    widths : vector
        Of plays, as shares of a range.
    times : vector
        Time constants of lags [s]; with some the band is rate-dependent.
    mean, spread : vector, shape (s,)
        Of the state of motion.
    bells : rows, shape (b, s)
        RBF centres, in deviations from the mean: none but in bands of earlier versions.
    sharpness : float
        Of these, per squared deviation.
    shift, log_scale : rows, shape (outputs, 1 + s + b)
        Weights of the constant, of the state of motion, and of RBF centres: of what the model misses on
        average in the output's unit, and of the logarithm of how much.
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
        Integral of the autocorrelation of what is missed [s], or in samples where there are no
        ``times``; 0 where it is not known. Not for the band, but for what is drawn from it
        (`mckibben.control.Twin`).
    """

    kind: ClassVar[str] = "band"
    ports: ClassVar[Ports] = ("driving", "given"), (), ("given",)
    kernel: ClassVar[Step] = band_step
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
        n_x, n_given, terms = len(self.inputs), len(self.given), 1 + self._n_seen + len(self.bells)
        fits = {
            "ends": [n_x] * 2,
            "bells": [self._n_seen] * len(self.bells),
            "shift": [terms] * n_given,
            "log_scale": [terms] * n_given,
            "limits": [4] * n_given,
            "scores": [max(len(self.scores[0]) if self.scores else 0, 2)] * n_given,
        }
        for name, wanted in fits.items():
            if [len(row) for row in getattr(self, name)] != wanted:
                raise ModelError(f"the {name} of a band do not fit. Remedy: calibrate again.")
        if {len(self.mean), len(self.spread)} != {self._n_seen} or not self.driving:
            raise ModelError("the state of a band does not fit. Remedy: calibrate again.")
        positive = (*self.widths, *self.times, *self.spread, self.sharpness)
        if min(positive) <= 0 or any(a >= b for a, b in zip(*self.ends, strict=True)):
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
        return len(self.inputs) + self.n_states

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        return bool(self.times)

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
        """State of motion, and terms."""
        return 1 + 2 * self._n_seen + len(self.bells)

    def coefficients(self, sample_time: float | None) -> Array:
        step = needs_sample_time(self.kind, sample_time) if self.times else 1.0
        keeps = np.exp(-step / np.array(self.times))
        places = [int(np.ceil(self.level * (len(row) - 1) - 1e-9)) for row in self.scores]
        quantiles = [row[place] for row, place in zip(self.scores, places, strict=True)]
        counts = [len(x) for x in (self.driving, self.given, self.widths, self.times, self.bells)]
        seen = (self.widths, keeps, self.mean, self.spread)
        weights = (self.bells, self.shift, self.log_scale, self.limits)
        numbers = (*counts, self.sharpness), self.ends, *seen, *weights, quantiles
        return np.concatenate([np.ravel(np.array(some, dtype=np.float64)) for some in numbers])

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
    """
    if not 0.0 < level < 1.0:
        raise ModelError(f"the level is {level:g}. Remedy: give one above 0 and below 1, as 0.9.")
    if level > units / (units + 1) + 1e-12:
        most, needed = 100 * units / (units + 1), int(np.ceil(level / (1.0 - level) - 1e-9))
        raise ModelError(
            f"a band calibrated on {units} {unit}(s) holds at most {numeral(most, 3)} %, and "
            f"{numeral(100 * level, 4)} % are asked for. Remedy: ask for less, or calibrate on at least "
            f"{needed} {unit}s."
        )


@dataclass(frozen=True, config=STRICT)
class Banded(Composition):
    """A model whose every output comes with a lower and an upper end.

    Parameters
    ----------
    forward : Block
        The model.
    band : Band
        Of its inputs and outputs; `mckibben.calibrate` finds it.

    Examples
    --------
    >>> import mckibben
    >>> banded = mckibben.Banded.example().at(0.8)
    >>> [channel.name for channel in banded.outputs]
    ['displacement', 'displacement_lower', 'displacement_upper']
    """

    kind: ClassVar[str] = "banded"
    no_inverse: ClassVar[str] = (
        "is a model with a band and has no inverse: a band is of outputs. Remedy: invert the model that "
        "was calibrated, or banded.forward."
    )
    parameters: ClassVar[tuple[str, ...]] = ("forward", "band")

    forward: Annotated[InstanceOf[Block], BeforeValidator(nested)]
    band: Annotated[InstanceOf[Band], BeforeValidator(nested)]

    path_dependent = same_as("forward.path_dependent")
    sample_time = same_as("forward.sample_time")
    inputs = same_as("forward.inputs")
    scheduling = same_as("forward.scheduling")
    outputs = same_as("band.outputs")
    start = same_as("forward.start")
    start_on = same_as("forward.start_on")

    def __post_init__(self) -> None:
        self.check_parts()
        if self.band.inputs != (*self.forward.inputs, *self.forward.outputs):
            raise ModelError(
                f"the band is of other channels than {self.forward.title!r}. Remedy: calibrate it again."
            )

    def at(self, level: float) -> Self:
        """Return the model with its band at another level, as `check_level` allows."""
        return replace(self, band=replace(self.band, level=float(level)))

    @property
    def title(self) -> str:
        return f"{self.forward.title}-banded"

    @property
    def parts(self) -> tuple[Block, ...]:  # type: ignore[override]
        return (self.forward, self.band)

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the model's state, then that of a motion that begins at rest.

        An explicit state may be this block's own, or the model's.
        """
        if initial is None or isinstance(initial, str) or len(initial) != self.forward.n_states:
            return super().initial_state(first, initial)
        own = self.forward.initial_state(first, initial)
        return np.concatenate([own, self.band.initial_state(first)])

    def wired(self, board: Layout, taken: Sequence[Any]) -> list[Any]:
        return self.band.wired(board, [*taken, *self.forward.wired(board, taken)])

    def joined(self, parts: Sequence[str]) -> str:
        return r"y = P[u],\quad (y^{-},\, y^{+}) = \text{band}[u, y]"

    @classmethod
    def example(cls) -> Self:
        """Return a Prandtl-Ishlinskii model with a band."""
        return cls(load("blocks", "pi").example(), Band.example())


def inside(model: Block) -> Block:
    """Return the model of one with a band; any other as it is."""
    return model.forward if isinstance(model, Banded) else model

"""Prediction bands of model outputs, and models with a band.

    lower = y - q (1 + k |dy/dt|),   upper = y + q (1 + k |dy/dt|),

where y is modelled, q is the half width at rest that a level asks for, and k how much wider the band is
at speed, 0 for a constant width. `mckibben.calibrate` finds both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Board
from mckibben.blocks.compose import Composition
from mckibben.blocks.fields import STRICT, Channel, Channels, Initial, Rows, Vector
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.parameters import one_per, same_as
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError, require
from mckibben.numerals import numeral
from mckibben.recording import Recording
from mckibben.registry import load


@step
def band_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Return, for every modelled output, its value and the lower and upper end of its band.

    Coefficients are the half widths at rest, then how much each grows by a change from sample to sample.
    The state is the last outputs, then whether there were any.
    """
    n = inputs.size
    for k in range(n):
        half = coefficients[k]
        if state[n] > 0.0:
            half += coefficients[n + k] * abs(inputs[k] - state[k])
        state[k] = inputs[k]
        outputs[3 * k] = inputs[k]
        outputs[3 * k + 1] = inputs[k] - half
        outputs[3 * k + 2] = inputs[k] + half
    state[n] = 1.0


@kernel
def band_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at rest, without a previous output."""
    state[:] = 0.0


@dataclass(frozen=True, config=STRICT)
class Band(Block):
    """Band: from a model's outputs to the outputs with lower and upper ends.

    Parameters
    ----------
    driving, given : tuple of Channel
        The model's inputs, and its outputs.
    ends : rows, shape (2, inputs and outputs)
        Lowest and highest of each in the calibration.
    widening : vector, shape (outputs,)
        Share by which the band is wider for every unit of speed [s per unit of the output]; 0 for a
        constant width.
    scores : rows, shape (outputs, any)
        Half width at rest, at evenly spaced levels from 0 to 1 [unit of the output].
    units : int
        Number of exchangeable runs, or blocks of runs, in the calibration.
    unit : {"run", "block"}
        Which of them.
    level : float
        Share of the samples of a new run that the band is to hold, between 0 and units / (units + 1).
    memory : float
        Correlation length of the errors [s]; 0 where it is not known. For what is drawn from the band
        (`mckibben.control.Twin`).
    """

    kind = "band"
    ports = ("given",), (), ("given",)
    kernel = band_step
    start_kernel = band_start
    parameters = ("widening",)
    n_states = one_per("given", 1)  # the last outputs, and whether there were any
    made_again = "calibrate the model again, with `calibrate()`"
    formulas = (r"y^{\pm} = y \pm q\,(1 + k\,|\dot y|)",)

    driving: Channels
    given: Channels
    ends: Rows
    widening: Annotated[Vector, "k_{k} [s/{out0}]"]
    scores: Rows
    units: Annotated[int, Field(ge=1)]
    unit: Literal["run", "block"] = "run"
    level: float = 0.9
    memory: Annotated[FiniteFloat, Field(ge=0)] = 0.0

    def __post_init__(self) -> None:
        n = len(self.given)
        lengths = {len(self.widening), len(self.scores)}
        if [len(row) for row in self.ends] != [len(self.driving) + n] * 2 or lengths != {n}:
            raise ModelError(
                "the numbers of a band do not fit its channels", remedy="calibrate again"
            )
        if any(low > high for low, high in zip(*self.ends, strict=True)) or min(self.widening) < 0:
            raise ModelError(
                "a range or a widening of a band is negative", remedy="calibrate again"
            )
        if any(len(row) < 2 or list(row) != sorted(row) or row[0] < 0 for row in self.scores):
            raise ModelError("the scores of a band do not rise", remedy="calibrate again")
        check_level(self.level, self.units, self.unit)

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        return any(self.widening)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """For every output of the model: the output, its lower and its upper end."""
        return tuple(
            Channel(f"{channel.name}{end}", channel.unit)
            for channel in self.given
            for end in ("", "_lower", "_upper")
        )

    def coefficients(self, sample_time: float | None) -> Array:
        step = needs_sample_time(self.kind, sample_time) if self.rate_dependent else 1.0
        half = np.array(
            [row[int(np.ceil(self.level * (len(row) - 1) - 1e-9))] for row in self.scores]
        )
        return np.concatenate([half, half * self.widening / step])

    @classmethod
    def example(cls) -> Self:
        return cls(
            driving=(Channel("pressure", "bar"),),
            given=(Channel("displacement", "mm"),),
            ends=((0.0, -1.0), (6.0, 40.0)),
            widening=(0.02,),
            scores=((0.0, 0.25, 0.5, 0.75, 1.0, 2.0),),
            units=19,
        )


def check_level(level: float, units: int, unit: str) -> None:
    """Raise an error for an invalid level, or one that the number of exchangeable units does not allow.

    A new one is as likely as each of them to be missed most, and nothing bounds by how much.
    """
    require(0.0 < level < 1.0, "level", level, "one above 0 and below 1, as 0.9")
    if level > units / (units + 1) + 1e-12:
        most, needed = 100 * units / (units + 1), int(np.ceil(level / (1.0 - level) - 1e-9))
        raise ModelError(
            f"a band calibrated on {units} {unit}(s) holds at most {numeral(most, 3)} %, "
            f"and {numeral(100 * level, 4)} % are requested",
            remedy=f"request less, or calibrate on at least {needed} {unit}s",
        )


@dataclass(frozen=True, config=STRICT)
class Banded(Composition):
    """A model whose outputs have lower and upper ends.

    Parameters
    ----------
    forward : Block
        The model.
    band : Band
        Of its outputs; `mckibben.calibrate` finds it.

    Examples
    --------
    >>> import mckibben
    >>> banded = mckibben.Banded.example().at(0.8)
    >>> [channel.name for channel in banded.outputs]
    ['displacement', 'displacement_lower', 'displacement_upper']
    """

    kind = "banded"
    no_inverse = "is a model with a band and has no inverse: a band is of outputs"
    instead = "invert the model that was calibrated, or banded.forward"
    parameters = ("forward", "band")

    forward: Annotated[InstanceOf[Block], BeforeValidator(nested)]
    band: Annotated[InstanceOf[Band], BeforeValidator(nested)]

    path_dependent = same_as("forward.path_dependent")
    inputs = same_as("forward.inputs")
    scheduling = same_as("forward.scheduling")
    outputs = same_as("band.outputs")
    start = same_as("forward.start")

    def __post_init__(self) -> None:
        if (self.band.driving, self.band.given) != (self.forward.inputs, self.forward.outputs):
            raise ModelError(
                f"the band is of other channels than {self.forward.title!r}",
                remedy="calibrate it again",
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

    def _known_of_parts(self) -> list[tuple[tuple[Channel, ...], Array]]:
        """Return inputs with the ranges of the model, then with those of the calibration."""
        forward, calibrated = self.forward, np.transpose(self.band.ends)[: len(self.inputs)]
        return [(forward.inputs, forward.known_inputs), (forward.inputs, calibrated)]

    def initial_state(
        self, first: Array, initial: Initial | None = None, sample_time: float | None = None
    ) -> Array:
        """Return the model's initial state, and that of the band at rest.

        An explicit state may be this block's own, or the model's.
        """
        if initial is None or isinstance(initial, str) or len(initial) != self.forward.n_states:
            return super().initial_state(first, initial, sample_time)
        state = self.forward.initial_state(first, initial, sample_time)
        return np.concatenate([state, np.zeros(self.band.n_states)])

    def start_on(self, recording: Recording) -> Array:
        start = self.forward.start_on(recording)
        return np.concatenate([start, np.zeros(self.band.n_states)])

    def wired(self, board: Board, taken: Sequence[Any]) -> list[Any]:
        return self.band.wired(board, self.forward.wired(board, taken))

    def joined(self, parts: Sequence[str]) -> str:
        return r"y = P[u],\quad (y^{-},\, y^{+}) = \text{band}[y]"

    @classmethod
    def example(cls) -> Self:
        return cls(load("blocks", "pi").example(), Band.example())


def inside(model: Block) -> Block:
    """Return the model without its band; other blocks unchanged."""
    return model.forward if isinstance(model, Banded) else model

"""A compensator that looks ahead: model-predictive, with limits of pressure, its rate and the supply.

In every sample the exact inverse runs over the references of a horizon from the memory that the muscles
really have. What it gives is used where limits let it: then this is the exact inverse. Where they do
not, all pressures of the horizon are planned together (`mckibben.blocks.predictive.plan`), along the
model's own prediction, hysteresis and all; the first is given, and the model takes that step. So a
reversal that the supply is too slow for begins early, and errors are shared before and after.

References come ``horizon - 1`` samples ahead, one a sample, and are kept until they are due.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt, Interval, Le
from pydantic import BeforeValidator, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Cost, Kernel, Run, Start, explicit_state, needs_sample_time
from mckibben.blocks.fields import STRICT, Channel, Initial, Vector
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.inverse import drives
from mckibben.blocks.kernels import Step
from mckibben.blocks.notation import Notation
from mckibben.blocks.predictive.horizon import (
    PASSES,
    STILL,
    horizon_scratch,
    kernels_of,
    plan_for_one,
)
from mckibben.blocks.predictive.memory import memory_of, resume_of, undoing
from mckibben.blocks.predictive.plan import MOST_STEPS, plan, plan_scratch
from mckibben.blocks.predictive.plan_one import one_scratch
from mckibben.blocks.predictive.supply import allowed, limit_rows
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError

NUDGE = 1e-3
"""Of the pressure range: by how much pressures are moved to see the model's slope."""

MOST = 1e6
"""Of limits: bar, or bar/s."""

Limit = Annotated[FiniteFloat, Gt(0), Le(MOST)]


@dataclass(frozen=True, config=STRICT)
class Predictive(Block):
    """A compensator with limits, which are looked at over a horizon.

    Parameters
    ----------
    compensator : Block
        From references, and what schedules it, to pressures: an exact inverse.
    horizon : int
        Samples that are planned, the present one included.
    rate_limit : float, optional
        Fastest change of every pressure [bar/s].
    pressure_range : (float, float), optional
        Lowest and highest pressure [bar]; default the compensator's own.
    total_limit : float, optional
        Highest sum of all pressures [bar].
    flow_limit : float, optional
        Most air that the supply gives: rates of all pressures that rise, by volumes, together [bar/s].
    volumes : sequence of n float
        Of muscles, relative to one another, positive; 1 each by default.
    """

    kind: ClassVar[str] = "predictive"
    undoing: ClassVar[bool] = True
    parameters: ClassVar[tuple[str, ...]] = ("compensator",)
    rate_dependent: ClassVar[bool] = True
    path_dependent: ClassVar[bool] = True
    notation: ClassVar[Notation] = Notation(
        r"\min_{p} \sum_{t=0}^{N-1} \left(r_t - P[p]_t\right)^2 \quad\text{such that}\quad "
        r"p_{\min} \le p_t \le p_{\max},\quad |p_t - p_{t-1}| \le \rho T,\quad "
        r"\sum_k p_{k,t} \le S,\quad \sum_k V_k \max(p_{k,t} - p_{k,t-1}, 0) \le Q T",
        rate_limit=r"\rho [bar/s]",
        total_limit="S [bar]",
        flow_limit="Q [bar/s]",
        volumes="V_k",
    )

    compensator: Annotated[InstanceOf[Block], BeforeValidator(nested)]
    horizon: Annotated[int, Interval(ge=1, le=200)] = 20
    rate_limit: Limit | None = None
    pressure_range: tuple[FiniteFloat, FiniteFloat] | None = None
    total_limit: Limit | None = None
    flow_limit: Limit | None = None
    volumes: Vector = ()

    def __post_init__(self) -> None:
        memory_of(self.compensator)
        n = len(self.outputs)
        if strange := [c.name for c in self.outputs if not drives(c)]:
            raise ModelError(
                f"{self.kind!r} plans what drives muscles, and {self.compensator.title!r} gives "
                f"{', '.join(strange)}. Remedy: give the compensator, from references to pressures."
            )
        if self.volumes and (len(self.volumes) != n or min(self.volumes) <= 0):
            raise ModelError(
                f"volumes of {self.kind!r} are {self.volumes}. Remedy: give {n} positive ones, or none."
            )
        low, high = self.pressures
        if not (np.isfinite([*low, *high]).all() and (low < high).all()):
            raise ModelError(
                f"{self.kind!r} plans pressures between {low.tolist()} and {high.tolist()} bar. "
                "Remedy: give pressure_range, the lower end first."
            )
        if self.total_limit is not None and self.total_limit <= low.sum():
            raise ModelError(
                f"all pressures at their lowest come to {low.sum():g} bar, but total_limit is "
                f"{self.total_limit:g}. Remedy: give a higher one."
            )

    @cached_property
    def undone(self) -> Block:
        """What the compensator undoes: from pressures to displacements."""
        return self.compensator.inverse()

    @cached_property
    def pressures(self) -> tuple[Array, Array]:
        """Lowest and highest pressure of every muscle [bar], shape (n,) each."""
        n = len(self.outputs)
        own = getattr(self.compensator, "pressure_range", None)
        ends = self.pressure_range or own
        if ends is not None:
            return np.full(n, ends[0]), np.full(n, ends[1])
        return self.compensator.reachable()

    @property
    def samples_ahead(self) -> int:  # type: ignore[override]
        """By how many samples references are given ahead of when they are due."""
        return self.horizon - 1

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """References, so many samples ahead; then what schedules the compensator, now."""
        return self.compensator.inputs

    @property
    def scheduling(self) -> tuple[str, ...]:
        """What schedules the compensator."""
        return self.compensator.scheduling

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Pressures."""
        return self.compensator.outputs

    @property
    def n_states(self) -> int:
        """The model's memory; references to come; last pressures, whether there are; plans made."""
        n = len(self.outputs)
        return self.undone.n_states + self.horizon * n + n + 2

    def rows(self, sample_time: float) -> Array:
        """Return all limits, as `mckibben.blocks.predictive.supply` says."""
        low, high = self.pressures
        most = [self.rate_limit, self.total_limit, self.flow_limit]
        rate, total, flow = (np.inf if limit is None else limit for limit in most)
        volumes = np.array(self.volumes or np.ones(len(low)).tolist())
        return limit_rows(low, high, rate * sample_time, total, flow * sample_time, volumes)

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the state before the first sample: as if its reference had been there all along."""
        if initial is not None and not isinstance(initial, str):
            return explicit_state(self, initial)
        n = len(self.outputs)
        own = memory_of(self.compensator)(self.compensator.initial_state(first, initial))
        return np.concatenate([own, np.zeros(self.horizon * n + n + 2)])

    @property
    def start(self) -> Initial:
        """The compensator's, where that has a name."""
        return self.compensator.start if isinstance(self.compensator.start, str) else "first_sample"

    @property
    def n_scratch(self) -> int:
        """States to try, pressures, slopes, and what a plan computes in."""
        rows = len(self.rows(1.0))
        return horizon_scratch(self.undone, self.compensator, self.horizon, rows)

    @cached_property
    def _kernels(self) -> tuple[Step, Start] | None:
        """Those of a compensator of one kernel; None where it is of several."""
        resume = resume_of(self.compensator)
        if resume is None or not isinstance(self.compensator.start, str):
            return None
        (undo_step, undo_start), (model_step, _) = self.compensator.c_kernels, self.undone.c_kernels
        one = len(self.outputs) == 1
        return kernels_of(model_step, undo_step, undo_start, resume, one=one)

    @property
    def kernel(self) -> Kernel | None:  # type: ignore[override]
        """That which looks ahead with the compensator's; None where that is of several."""
        return self._kernels[0] if self._kernels else None

    @property
    def start_kernel(self) -> Start | None:  # type: ignore[override]
        """As `kernel`."""
        return self._kernels[1] if self._kernels else None

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the coefficients that `mckibben.blocks.predictive.horizon` names.

        Raises
        ------
        ModelError
            If the compensator is of several kernels, which C does not run ahead.
        """
        if self._kernels is None:
            raise ModelError(
                f"{self.compensator.title!r} cannot be run ahead in C. Remedy: export pi, gpi or "
                "balance that starts at its first sample, or stream this one from Python."
            )
        rows = self.rows(needs_sample_time(self.kind, sample_time))
        low, high = self.pressures
        own = self.undone.coefficients(sample_time), self.compensator.coefficients(sample_time)
        blocks = (self.undone, self.compensator)
        head = [len(low), self.horizon, len(rows), *(block.n_states for block in blocks)]
        head += map(len, own)
        return np.concatenate([head, NUDGE * (high - low), low, rows.ravel(), *own])

    @property
    def needs_double(self) -> str:
        """Of several muscles: their plan is solved for step by step, and would be off by 0.2 %."""
        return "plans several muscles, for which single precision is too coarse" * (
            len(self.outputs) > 1
        )

    def cost(self, sample_time: float | None) -> Cost:
        """Return that of the inverse over the horizon; at worst, of all plans too."""
        n, length = len(self.outputs), self.horizon
        inverse = self.compensator.cost(sample_time).usual
        answers = PASSES * (n + 1) * self.undone.cost(sample_time).usual
        step = 2 * n**3 + len(self.rows(1.0)) * (4 * n * n + 12 * n + 20)
        planned = PASSES * (4 * length if n == 1 else MOST_STEPS * step)
        return Cost(length * inverse, length * (inverse + answers + planned))

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that looks ahead at every sample."""
        if self._kernels is not None:
            return super().bind(sample_time, state, inputs, outputs)
        horizon = _Horizon(self, needs_sample_time(self.kind, sample_time), state)

        def run() -> None:
            for t in range(len(inputs)):
                outputs[t] = horizon.step(inputs[t])

        return run

    @classmethod
    def example(cls) -> Self:
        """Return the inverse of a Prandtl-Ishlinskii model behind a slow valve."""
        return cls(PI.example().inverse(), horizon=8, rate_limit=10.0)


class _Horizon:
    """What a compensator of several kernels computes in, bound to its state."""

    def __init__(self, block: Predictive, sample_time: float, state: Array) -> None:
        model, undo = block.undone, block.compensator
        n, length = len(block.outputs), block.horizon
        self.n, self.length = n, length
        self.rows = block.rows(sample_time)
        low, high = block.pressures
        self.lowest, self.nudges = low, NUDGE * (high - low)
        ends = np.cumsum([model.n_states, length * n, n, 1])
        self.memory, wished, self.before, self.started, self.planned = np.split(state, ends)
        self.wished = wished.reshape(length, n)
        self.undoing: Callable[[Array], Array] = undoing(undo)
        self.undoing_state = np.empty(undo.n_states)
        self.given = np.empty((length, len(undo.inputs)))
        self.inverted = np.empty((length, n))
        self.invert = undo.bind(sample_time, self.undoing_state, self.given, self.inverted)
        self.trial, self.kept = np.empty((2, model.n_states))
        self.driven, self.answer = np.empty((1, len(model.inputs))), np.empty((1, n))
        self.answers = model.bind(sample_time, self.trial, self.driven, self.answer)
        self.slopes = np.empty((length, n, n))
        self.errors, self.planning = np.empty((2, length, n))
        needed = one_scratch(length) if n == 1 else plan_scratch(length, n, len(self.rows))
        self.scratch = np.empty(needed)

    def step(self, inputs: Array) -> Array:
        """Return the pressures of a sample, shape (n,), and take the step."""
        first = not self.started[0]
        self.wished[:-1] = inputs[: self.n] if first else self.wished[1:]
        self.wished[-1] = inputs[: self.n]
        self.given[:, : self.n] = self.wished
        self.given[:, self.n :] = self.driven[0, self.n :] = inputs[self.n :]
        self.undoing_state[:] = self.undoing(self.memory)
        self.invert()
        if first:  # whatever the rate
            self.before[:] = self.inverted[0]
            allowed(self.rows[self.rows[:, 0] == 0.0].ravel(), self.lowest, self.before)
            self.started[0] = 1.0
        pressures = self.inverted.copy()
        if not self._kept_to(pressures):
            pressures = self._planned()
            self.planned[0] += 1.0
        self.before[:] = pressures[0]
        self.trial[:] = self.memory
        self._answered(self.before)
        self.memory[:] = self.trial
        return self.before

    def _kept_to(self, pressures: Array) -> bool:
        """Clip pressures of a horizon to all limits, in turn; tell whether they kept to them."""
        there, before = True, self.before
        for row in pressures:
            there = allowed(self.rows.ravel(), before, row) and there
            before = row
        return there

    def _planned(self) -> Array:
        """Return the pressures of a horizon that come nearest to the references, within limits."""
        pressures = self.inverted
        for _ in range(PASSES):
            self._linearised(pressures)
            slopes, nominal, errors, planned = (
                table.reshape(-1) for table in (self.slopes, pressures, self.errors, self.planning)
            )
            given = (slopes, nominal, errors, planned, self.scratch)
            planner = plan_for_one if self.n == 1 else plan
            planner(self.n, self.rows.ravel(), self.before, *given)
            pressures = self.planning.copy()
            self._kept_to(pressures)
        return pressures

    def _answered(self, pressures: Array) -> Array:
        self.driven[0, : self.n] = pressures
        self.answers()
        return self.answer[0]

    def _linearised(self, pressures: Array) -> None:
        """Find the errors along pressures, and the model's slopes where the motion goes on."""
        way, before = np.ones(self.n), self.before
        self.kept[:] = self.memory
        for t, row in enumerate(pressures):
            moved = row - before
            way = np.where(np.abs(moved) > STILL * self.nudges, np.sign(moved), way)
            self.trial[:] = self.kept
            answer = self._answered(row).copy()
            after = self.trial.copy()
            for k in range(self.n):
                nudged = row.copy()
                nudged[k] += way[k] * self.nudges[k]
                self.trial[:] = self.kept
                change = self._answered(nudged) - answer
                self.slopes[t, :, k] = change / (way[k] * self.nudges[k])
            self.errors[t] = self.wished[t] - answer
            self.kept[:] = after
            before = row

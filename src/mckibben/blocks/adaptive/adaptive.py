"""An inverse that learns from what is measured, and stays exact.

Inputs are those of the inverse, then what is measured of the references; outputs are the inverse's.
With every measured sample the parameters of the model follow, see `learning`; the inverse runs with
them as they are, so that model and inverse match at every step.

A measurement answers the reference of the step before, as behind a compensator: since the model gives
exactly what was asked for, what it predicts is known from the inverse's own memory.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt
from pydantic import BeforeValidator, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.adaptive.adaptable import Adaptable
from mckibben.blocks.adaptive.drift import FIT_ERROR, Drift, alarm_limit, scatter
from mckibben.blocks.adaptive.learning import (
    LARGEST,
    READY,
    SENSES,
    SQUARED,
    STOOD,
    USUAL,
    covariance_of,
    start_root,
)
from mckibben.blocks.base import Block, Cost, Kernel, Start, explicit_state, needs_sample_time
from mckibben.blocks.compose import Series
from mckibben.blocks.feedback.pid import MEASURED
from mckibben.blocks.fields import STRICT, Channel, Initial, Vector, vector
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.memoryless.affine import Affine
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError

TRUSTED = 1 / 3
"""Standard deviations of the fitted parameters at the start, by those of changes to be expected."""


TIMES = 1e-3, 1e9
"""Shortest and longest time to learn in [s]."""
NOISES = 1e-9, 1e3
"""Least and most noise, by the width of what is reached."""

FARTHEST = 1e6
"""Scales, and variances expected, that no parameter goes beyond."""
MOST = 1e12
"""Beyond what memory of an inverse is, and samples are counted."""


def learner_of(block: Block) -> Adaptable | None:
    """Return what learns while a block is undone: it, or what undoes it; None where none does."""
    if isinstance(block, Inverse):
        inner = block.forward
        return inner if isinstance(inner, Adaptable) and not inner.learns_inverted else None
    return block if isinstance(block, Adaptable) and block.learns_inverted else None


def told_width(model: Block, learner: Adaptable) -> float:
    """Return the widest range that a model reaches, or else where it was fitted; 0 if unknown."""
    low, high = model.reachable()
    width = float(np.max(high - low))
    return width if np.isfinite(width) else learner.known_span


def check_settings(kind: str, time: float, noise: float, width: float) -> None:
    """Refuse times and noises, in the unit of ``width``, that nothing is measured with."""
    if not TIMES[0] <= time <= TIMES[1]:
        raise ModelError(
            f"{kind!r} cannot learn in a time of {time:g} s. Remedy: give {TIMES[0]:g} to "
            f"{TIMES[1]:g} s."
        )
    low, high = (bound * width for bound in NOISES) if 0 < width < np.inf else NOISES
    if not low <= noise <= high:
        raise ModelError(
            f"a noise of {noise:g} is none that {kind!r} is measured with. Remedy: give the standard "
            f"deviation of what is measured, {low:.3g} to {high:.3g} in its unit."
        )


@dataclass(frozen=True, config=STRICT)
class Adaptive(Block):
    """The inverse of a block, which learns the block's linear parameters while it runs.

    Parameters
    ----------
    forward : Block
        The block undone, which declares what of it is learnt; or its inverse does, as of a balance.
    time : float
        How long it takes to learn what the motion shows [s]; positive.
    noise : float
        Standard deviation of what is measured [unit of the output]; errors below are not told apart.
    memory : sequence of float, optional
        State to go on from, or what is learnt of it, as `resumed` keeps it; default is to start from
        the fit.
    """

    kind: ClassVar[str] = "adaptive"
    undoing: ClassVar[bool] = True
    rate_dependent: ClassVar[bool] = True
    parameters: ClassVar[tuple[str, ...]] = ("forward",)

    forward: Annotated[InstanceOf[Adaptable] | InstanceOf[Inverse], BeforeValidator(nested)]
    time: Annotated[FiniteFloat, Gt(0)]
    noise: Annotated[FiniteFloat, Gt(0)]
    memory: Vector | None = None

    def __post_init__(self) -> None:
        self.learner.check_invertible()
        check_settings(self.kind, self.time, self.noise, told_width(self.forward, self.learner))
        if self.memory is not None and len(self.memory) not in (self.n_states, self.n_learnt):
            raise ModelError(
                f"the memory of {self.kind!r} has {len(self.memory)} numbers, its state "
                f"{self.n_states}. Remedy: resume what was saved with the same model."
            )
        if self.memory is not None:
            self.check_memory(np.array(self.memory))

    def check_memory(self, state: Array) -> None:
        """Refuse a state, or what is learnt of one, that learning never comes to.

        Raises
        ------
        ModelError
            If so.
        """
        own, theta, used, root, senses = self._split(state)
        learner, fixed = self.learner, self.fixed
        p, senses = theta.size, senses.reshape(-1, SENSES)
        with np.errstate(all="ignore"):
            far = np.abs(np.array([theta, used]) - learner.taught) > FARTHEST * learner.scales
            variances = np.diag(covariance_of(root, p))
            wide = variances > FARTHEST * np.diag(learner.spread)
        ready, usual = senses[:, READY], senses[:, USUAL]
        wrong = {
            "hysteresis": (np.abs(own) > MOST).any(),
            "parameters": far.any(),
            "covariance": not (root[:p] > 0).all() or wide.any(),
            "readings": not ((ready >= 0) & (ready <= p) & (ready == np.round(ready))).all(),
            "errors": not (senses[:, [USUAL, SQUARED, STOOD]] > 0).all()
            or (usual > 2 * LARGEST * self.noise).any(),
        }
        for name, found in wrong.items():
            if found:
                raise ModelError(
                    f"the {name} in the memory of {self.kind!r} cannot have come from running it. "
                    "Remedy: save the model afresh, or resume what was saved unchanged."
                )
        for parameters in (theta, used):
            held = learner.retaught(parameters)
            if isinstance(held, Adaptable):
                held.check_invertible()
        if own.size:
            fixed.initial_state(np.zeros(len(fixed.inputs)), own[: fixed.n_states].tolist())

    @property
    def learner(self) -> Adaptable:
        """What declares what is learnt: the block undone, or what undoes it.

        Raises
        ------
        ModelError
            Where none does.
        """
        found = learner_of(self.forward)
        if found is None:
            raise ModelError(
                f"{self.forward.title!r} does not learn. Remedy: give a pi, gpi or balance model."
            )
        return found

    @property
    def fixed(self) -> Block:
        """The inverse that does not learn."""
        return self.forward.inverse()

    @property
    def title(self) -> str:
        """That of the block undone, and that it learns."""
        return f"{self.learner.title}-adaptive"

    @property
    def path_dependent(self) -> bool:  # type: ignore[override]
        """As the forward block says."""
        return self.fixed.path_dependent

    @property
    def measured(self) -> tuple[Channel, ...]:
        """What is measured of the references."""
        return tuple(Channel(f"{c.name}{MEASURED}", c.unit) for c in self.forward.outputs)

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """References, what schedules the forward block, measurements."""
        return (*self.fixed.inputs, *self.measured)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """What schedules the forward block, and measurements."""
        return (*self.forward.scheduling, *(channel.name for channel in self.measured))

    @property
    def n_missable(self) -> int:
        """Measurements: the inverse goes on without."""
        return len(self.measured)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """The forward block's driven inputs."""
        return self.fixed.outputs

    @property
    def n_states(self) -> int:
        """The inverse's, what more learning wants of the last sample, and what is learnt."""
        return self.fixed.n_states + self.learner.n_more_states + self.learner.n_learning_states

    @property
    def n_learnt(self) -> int:
        """Numbers of the state that are learnt."""
        return self.learner.n_learning_states

    @property
    def n_scratch(self) -> int:
        """Three numbers a parameter, what more the family wants, and those of the inverse."""
        more = self.learner.n_learning_scratch + self.fixed.n_scratch
        return 3 * self.learner.taught.size + more

    @property
    def start(self) -> Initial:
        """Memory to go on from, or the forward block's start."""
        return self.forward.start if self.memory is None else self.memory

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the state before the first sample: the inverse's, and parameters as fitted.

        An explicit state may be this block's own, the inverse's or the forward block's.
        """
        start = self.start if initial is None else initial
        asked = first[: len(first) - len(self.measured)]
        if not isinstance(start, str) and len(start) == self.n_states:
            return explicit_state(self, start)
        learner = self.learner
        if not isinstance(start, str) and len(start) == self.n_learnt:
            learnt = np.array(start)
            self._split(learnt)[4][READY::SENSES] = 0.0  # the next measurement answers nothing
            own = self.fixed.initial_state(asked, self.forward.start)
            return np.concatenate([own, np.zeros(learner.n_more_states), learnt])
        if isinstance(start, str):
            return super().initial_state(first, start)
        state = self.initial_state(first, "first_sample")
        state[: self.fixed.n_states] = self.fixed.initial_state(asked, start)
        return state

    def _split(self, state: Array) -> tuple[Array, Array, Array, Array, Array]:
        p = self.learner.taught.size
        sizes = [len(state) - self.n_learnt, p, p, (p * (p + 1)) // 2]
        own, theta, used, root, senses = np.split(state, np.cumsum(sizes))
        return own, theta, used, root, senses

    @property
    def _fresh(self) -> Array:
        return start_root(self.learner.spread * TRUSTED**2)

    def _settings(self, sample_time: float | None) -> Array:
        step = needs_sample_time(self.kind, sample_time)
        return np.array([min(step / self.time, 0.5), self.noise, 1.0 / len(self.measured)])

    @property
    def kernel(self) -> Kernel:  # type: ignore[override]
        """That of the family that learns."""
        return self.learner.adaptive_kernel

    @property
    def start_kernel(self) -> Start:  # type: ignore[override]
        """That of the family that learns."""
        return self.learner.adaptive_start_kernel

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [number of parameters, settings, scales, widest, theta, root], then the family's."""
        learner = self.learner
        return np.concatenate(
            [
                [float(learner.taught.size)],
                self._settings(sample_time),
                learner.scales,
                np.diag(learner.spread),
                learner.taught,
                self._fresh,
                learner.adaptive_numbers(sample_time),
            ]
        )

    def cost(self, sample_time: float | None) -> Cost:
        """Return that of the inverse, and three operations a number of the covariance."""
        p = self.learner.taught.size
        learnt = 6 * p * p + 20 * p
        return self.fixed.cost(sample_time) + Cost(learnt, learnt)

    def reachable(self) -> tuple[Array, Array]:
        """Return what the inverse gives."""
        return self.fixed.reachable()

    @property
    def undone(self) -> Block:
        """The forward block, as fitted."""
        return self.forward

    def present(self, state: Array) -> Block:
        """Return the forward block that the inverse runs with in a state, shape (n_states,)."""
        return taught(self.learner, self._split(state)[2])

    def drift(self, state: Array) -> Drift:
        """Return how far what is learnt has gone from the fit, in a state, shape (n_states,)."""
        learner = self.learner
        limit = alarm_limit(self.time, len(learner.groups))
        _, theta, _, root, senses = self._split(state)
        if not senses[READY::SENSES].any():
            none = (0.0,) * len(learner.groups)
            return Drift(learner.groups, none, (FIT_ERROR,) * len(none), limit, measured=False)
        steps = 1e-6 * np.diag(learner.scales)
        there = learner.group_changes(theta)
        slopes = np.array([(learner.group_changes(theta + h) - there) / 1e-6 for h in steps]).T
        covariance = covariance_of(root, theta.size)
        usual = float(senses[USUAL::SENSES].max())
        moved = learner.whole_changes
        left = np.divide(usual, moved, out=np.zeros(moved.size), where=moved > 0)
        errors = scatter(covariance, slopes, left)
        return Drift(learner.groups, vector(there), vector(errors), limit)

    def resumed(self, state: Array, memory: bool = True) -> Self:
        """Return this block, which goes on from a state when it is next started.

        Without ``memory`` of its hysteresis it keeps what is learnt alone: muscles were vented since.
        """
        kept = np.asarray(state, dtype=np.float64)[0 if memory else -self.n_learnt :]
        return replace(self, memory=tuple(kept.tolist()))

    def equations(self) -> tuple[str, ...]:
        """Return what is undone, and how parameters follow."""
        return (
            r"\hat{u}_t = P_{\theta_t}^{-1}[y]_t",
            r"\theta_t = \Pi\left(\theta_{t-1} + \frac{C \varphi}{1 + \varphi^T C \varphi}\, e_t"
            r"\right),\quad e_t = y_{m,t} - P_{\theta_{t-1}}[\hat{u}]_{t-1}",
        )

    @classmethod
    def example(cls) -> Self:
        from mckibben.blocks.hysteresis.pi import PI

        return cls(PI.example(), 60.0, 0.05)


def taught(learner: Adaptable, theta: Array) -> Block:
    """Return a forward block with other parameters, shape (p,), and behind it what is added."""
    block, added = learner.retaught(theta), learner.added(theta)
    if not added:
        return block
    output = block.outputs[0]
    return Series((block, Affine(1.0, added, output, output)))

"""Adaptive inverses, which estimate parameters from measurements and remain exact.

Inputs are those of the inverse, then the measurements of the references; outputs are the inverse's.
Every measured sample updates the parameters of the model, see `mckibben.blocks.learning`. The inverse
uses the updated parameters, so that model and inverse match at every step.

A measurement belongs to the reference of the step before, as behind a compensator: the model's output
equals the reference, so the prediction follows from the inverse's own state. In a series one part is
adaptive (mpi, cpi, a balance behind its valves): the parts after it are inverted both for the
measurement and for the reference, each with its own state; the parts before it are inverted for the
output of the adaptive inverse. A measurement delayed by a dead time is first corrected by the change of
the reference since then (`Prompt`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from annotated_types import Gt
from pydantic import BeforeValidator, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Advance, Block, Board, Start
from mckibben.blocks.compose import Layout, Series
from mckibben.blocks.fields import (
    LONGEST_DELAY,
    STRICT,
    Channel,
    ChannelField,
    Initial,
    Vector,
    vector,
)
from mckibben.blocks.inverse import Inverse, Invertible
from mckibben.blocks.kernels import Step, kernel, remember, step
from mckibben.blocks.learning import READY, SENSES, USUAL, Learnable, start_root
from mckibben.blocks.parameters import same_as
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.blocks.saving import nested
from mckibben.blocks.starts import stated
from mckibben.errors import ModelError, require
from mckibben.recording import MEASURED

INITIAL_SPREAD = 1 / 3
"""Initial standard deviations of the fitted parameters, relative to those of the expected changes.
"""

TIMES = 1e-3, 1e9
"""Shortest and longest adaptation time [s]."""
NOISES = 1e-9, 1e3
"""Smallest and largest noise, relative to the reachable range."""


def learnable_of(block: Block) -> Learnable | None:
    """Return the adaptive parameters of a block, as it or its inverse declares; None if it has none."""
    inner = block.forward if isinstance(block, Inverse) else block
    learnable = inner.learnable if isinstance(inner, Invertible) else None
    return learnable if learnable and learnable.compensates == isinstance(block, Inverse) else None


def learning_part(model: Block) -> tuple[tuple[Block, ...], Block, tuple[Block, ...]]:
    """Return the parts of a model before its adaptive part, that part, and the parts after it.

    Raises
    ------
    ModelError
        Where no part learns, or several do.
    """
    parts = model.parts if isinstance(model, Series) else (model,)
    places = [k for k, part in enumerate(parts) if learnable_of(part) is not None]
    if len(places) != 1:
        raise ModelError(
            f"{len(places)} parts of {model.title!r} can adapt",
            remedy="adapt a pi, gpi, mpi, cpi or balance model with one adaptive part",
        )
    return parts[: places[0]], parts[places[0]], parts[places[0] + 1 :]


def width_of(parts: Sequence[Block]) -> float:
    """Return the largest output range of a part, or its fitted range, after other parts."""
    low, high = parts[0].reachable()
    learnable = learnable_of(parts[0])
    if learnable and learnable.known is not None and not np.isfinite([*low, *high]).all():
        low, high = learnable.known.T
    for part in parts[1:]:
        low, high = part.passes(low, high)
    return float(np.max(high - low))


@step
def prompt_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Correct a measurement for dead time; the state is past references, latest first."""
    late = int(coefficients[0])
    outputs[0] = inputs[1] + state[0] - state[late]
    remember(inputs[0], state[: late + 1])


@kernel
def prompt_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start as if the first reference had always been applied."""
    state[:] = inputs[0]


@dataclass(frozen=True, config=STRICT)
class Prompt(Block):
    """Correction of measurements for dead time: shifted by the reference's change meanwhile.

    Parameters
    ----------
    late : float
        Dead time [s].
    reference, measured : Channel
        Reference, and its measurement.
    """

    kind = "prompt"
    kernel = prompt_step
    start_kernel = prompt_start
    ports = ("reference", "measured"), (), ("measured",)
    rate_dependent = True
    n_missable = 1  # the measurement
    n_states = LONGEST_DELAY + 1
    parameters = ("late",)
    formulas = (r"y_t = y_{m,t} + r_{t-1} - r_{t-T_d/T}",)

    late: Annotated[FiniteFloat, Gt(0), "T_d [s]"]
    reference: Annotated[ChannelField, "r"]
    measured: Annotated[ChannelField, "y_{m}"]

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the dead time in samples, less the one of the sample hold."""
        late = round(self.late / needs_sample_time(self.kind, sample_time)) - 1
        return np.array([float(min(max(late, 0), LONGEST_DELAY))])

    @classmethod
    def example(cls) -> Self:
        return cls(0.1, Channel("displacement", "mm"), Channel(f"displacement{MEASURED}", "mm"))


@dataclass(frozen=True, config=STRICT)
class Adaptive(Block):
    """Inverse of a block that adapts the block's linear parameters while it runs.

    Parameters
    ----------
    forward : Block
        The inverted block, which declares its adaptive parameters, or whose inverse does, as of a
        balance; or a series of blocks, exactly one of which is adaptive.
    time : float
        Adaptation time [s]; positive.
    noise : float
        Standard deviation of the measurement noise [unit of the output]; smaller errors are not
        distinguished.
    memory : sequence of float, optional
        State to continue from, or its adaptive part, as `resumed` stores it; default is to start from
        the fit.
    """

    kind = "adaptive"
    inverts = True
    rate_dependent = True
    parameters = ("forward",)

    forward: Annotated[InstanceOf[Block], BeforeValidator(nested)]
    time: Annotated[FiniteFloat, Gt(0)]
    noise: Annotated[FiniteFloat, Gt(0)]
    memory: Vector | None = None

    path_dependent = same_as("fixed.path_dependent")
    outputs = same_as("fixed.outputs")
    reachable = same_as("fixed.reachable")
    sample_time = same_as("forward.sample_time")
    forward_model = same_as("forward")

    def __post_init__(self) -> None:
        learning_part(self.forward)
        self.forward.inverse()  # which refuses what has none
        self._check_settings()
        if self.memory is not None:
            if len(self.memory) not in (self.n_states, self.n_adapted):
                raise ModelError(
                    f"the memory of {self.kind!r} has {len(self.memory)} numbers, its "
                    f"state {self.n_states}",
                    parameter="memory",
                    remedy="resume what was saved with the same model",
                )
            self._check_memory(np.array(self.memory))

    def _check_settings(self) -> None:
        """Raise an error for an invalid adaptation time or noise."""
        shortest, longest = TIMES
        expectation = f"{shortest:g} to {longest:g} s"
        require(shortest <= self.time <= longest, "time", self.time, expectation)
        _, part, behind = learning_part(self.forward)
        width = width_of((part, *behind))
        low, high = (bound * width for bound in NOISES) if 0 < width < np.inf else NOISES
        expectation = (
            f"the standard deviation of what is measured, {low:.3g} to {high:.3g} in its unit"
        )
        require(low <= self.noise <= high, "noise", self.noise, expectation)

    def _check_memory(self, state: Array) -> None:
        """Raise an error for a state that adaptation cannot have reached."""
        if self.parts and len(state) == self.n_states:
            for part, share in self.shares(state):
                if part is self.core:
                    self.core._check_memory(share)  # of this class
                else:
                    part.initial_state(np.zeros(len(part.inputs)), share.tolist())
            return
        fixed_state, theta, parameters_used, root, senses = self._split(state)
        p, senses = theta.size, senses.reshape(-1, SENSES)
        counts = (senses[:, READY] >= 0) & (senses[:, READY] <= p) & (senses[:, USUAL] > 0)
        if not (counts.all() and (root[:p] > 0).all()):
            raise ModelError(
                f"the covariance or errors in that of {self.kind!r} are not positive",
                parameter="memory",
                remedy="save the model afresh, or resume what was saved unchanged",
            )
        for parameters in (theta, parameters_used):
            self.learnable.with_parameters(parameters).inverse()
        if fixed_state.size:
            fixed = self.fixed
            fixed.initial_state(np.zeros(len(fixed.inputs)), fixed_state[: fixed.n_states].tolist())

    # -- what it is made of ------------------------------------------------------------------

    @cached_property
    def core(self) -> Adaptive:
        """The adaptive core: this block, or a part of a series with the noise scaled by later parts."""
        if not isinstance(self.forward, Series):
            return self
        _, part, behind = learning_part(self.forward)
        slope = width_of((part, *behind)) / width_of((part,))
        core = Adaptive(part, self.time, self.noise / (slope if 0 < slope < np.inf else 1.0))
        adapted = self.memory is not None and len(self.memory) == core.n_adapted
        return replace(core, memory=self.memory) if adapted else core

    @cached_property
    def _around(self) -> tuple[Block | None, Block | None]:
        """Return the inverses of the parts after the core, and of those before it."""
        before, _, behind = learning_part(self.forward)
        inverse_behind = Series(behind).inverse() if behind else None
        return inverse_behind, Series(before).inverse() if before else None

    @cached_property
    def parts(self) -> tuple[Block, ...]:
        """Parts in a series: dead-time corrections, inverses of later parts, core, of earlier parts."""
        if self.core is self:
            return ()
        behind, before = self._around
        parts = (*self._prompt, behind, behind, self.core, before)
        return tuple(part for part in parts if part is not None)

    @cached_property
    def _prompt(self) -> tuple[Prompt, ...]:
        """Return the dead-time correction of every measurement."""
        late = self.forward.dead_time
        pairs = zip(self.forward.outputs, self.measured, strict=True)
        return tuple(Prompt(late, *pair) for pair in pairs) if late > 0 else ()

    @cached_property
    def learnable(self) -> Learnable:
        learnable = learnable_of(self.core.forward)
        assert learnable is not None
        return learnable

    @cached_property
    def fixed(self) -> Block:
        """The inverse without adaptation."""
        return self.forward.inverse()

    @property
    def title(self) -> str:
        block = self.forward
        return f"{block.forward.title if isinstance(block, Inverse) else block.title}-adaptive"

    @property
    def measured(self) -> tuple[Channel, ...]:
        """Measured channels of the references."""
        return tuple(Channel(f"{c.name}{MEASURED}", c.unit) for c in self.forward.outputs)

    @property
    def inputs(self) -> tuple[Channel, ...]:
        return (*self.fixed.inputs, *self.measured)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Scheduling inputs of the forward block, and measurements."""
        return (*self.forward.scheduling, *(channel.name for channel in self.measured))

    @property
    def n_missable(self) -> int:
        """Number of measurements that may be missing, if later parts have no memory."""
        behind = self._around[0]
        return len(self.measured) if behind is None or behind.n_states == 0 else 0

    # -- memory ------------------------------------------------------------------------------

    @cached_property
    def n_adapted(self) -> int:
        """Number of adaptive states: theta, used, root, senses."""
        p = self.learnable.fitted.size
        return 2 * p + (p * (p + 1)) // 2 + SENSES * len(self.core.forward.outputs)

    @property
    def n_states(self) -> int:
        """States of the inverse, auxiliary states of the last sample, and adaptive states."""
        if self.parts:
            return super().n_states
        return self.fixed.n_states + self.learnable.n_more_states + self.n_adapted

    @property
    def n_scratch(self) -> int:
        """Scratch: three numbers per parameter, that of the family, and that of the inverse."""
        if self.parts:
            return super().n_scratch
        more = self.learnable.n_more_scratch + self.fixed.n_scratch
        return 3 * self.learnable.fitted.size + more

    @property
    def start(self) -> Initial:
        """Saved state to resume from, or the forward block's start; for a series, each part's own."""
        if self.parts and (self.memory is None or len(self.memory) == self.n_adapted):
            return "first_sample"
        return self.forward.start if self.memory is None else self.memory

    def initial_state(
        self, first: Array, initial: Initial | None = None, sample_time: float | None = None
    ) -> Array:
        """Return the initial state: that of the inverse, with the fitted parameters.

        An explicit state may be this block's own or, but of a series, the inverse's or the forward
        block's.
        """
        start = self.start if initial is None else initial
        if self.parts:
            by_rule = initial is None and isinstance(start, str)  # each starts by a rule of its own
            return Layout(self).initial_state(first, None if by_rule else start, sample_time)
        if isinstance(start, str):
            return super().initial_state(first, start, sample_time)
        desired = first[: len(first) - len(self.measured)]
        if len(start) == self.n_states:
            return stated(self.kind, self.n_states, start)
        if len(start) == self.n_adapted:
            adapted = np.array(start)
            self._split(adapted)[4][READY::SENSES] = 0.0  # the next measurement has no prediction
            fixed_state = self.fixed.initial_state(desired, self.forward.start, sample_time)
            return np.concatenate([fixed_state, np.zeros(self.learnable.n_more_states), adapted])
        state = self.initial_state(first, "first_sample", sample_time)
        state[: self.fixed.n_states] = self.fixed.initial_state(desired, start, sample_time)
        return state

    def _core_state(self, state: Array) -> Array:
        return next((share for part, share in self.shares(state) if part is self.core), state)

    def _split(self, state: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return views of a state of the core: inverse state, theta, used, root and senses."""
        p = self.learnable.fitted.size
        sizes = [len(state) - self.n_adapted, p, p, (p * (p + 1)) // 2]
        fixed_state, theta, parameters_used, root, senses = np.split(state, np.cumsum(sizes))
        return fixed_state, theta, parameters_used, root, senses

    def resumed(self, state: Array, memory: bool = True) -> Self:
        """Return this block with a given state as its initial state.

        Without ``memory`` of the hysteresis only the adaptive part is stored, as after venting.
        """
        numbers = np.array(state, dtype=np.float64)
        numbers[[*self.clip_counts]] = 0.0  # of the run before
        return replace(
            self, memory=vector(numbers if memory else self._core_state(numbers)[-self.n_adapted :])
        )

    # -- running -----------------------------------------------------------------------------

    @property
    def kernel(self) -> Step | None:  # type: ignore[override]
        return None if self.parts else self.learnable.step

    @property
    def start_kernel(self) -> Start | None:  # type: ignore[override]
        return None if self.parts else self.learnable.start

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the coefficients described in `mckibben.blocks.learning.family_at`."""
        if self.parts:
            return super().coefficients(sample_time)
        step, learnable = needs_sample_time(self.kind, sample_time), self.learnable
        return np.concatenate(
            [
                [float(learnable.fitted.size), min(step / self.time, 0.5), self.noise],
                learnable.scales,
                np.diag(learnable.spread),
                learnable.fitted,
                start_root(learnable.spread * INITIAL_SPREAD**2),
                learnable.numbers(sample_time),
            ]
        )

    def bind(
        self, sample_time: float | None, state: Array, inputs: Array, outputs: Array
    ) -> Advance:
        run = Layout(self).bind if self.parts else super().bind
        return run(sample_time, state, inputs, outputs)

    def wired(self, board: Board, taken: Sequence[Any]) -> list[Any]:
        """Lay out the parts; those after the core twice."""
        if not self.parts:
            return super().wired(board, taken)
        behind, before = self._around
        by_name = dict(zip((channel.name for channel in self.inputs), taken, strict=True))
        m = len(self.measured)
        answers = list(taken[-m:])
        for j, part in enumerate(self._prompt):
            answers[j : j + 1] = part.wired(board, [taken[j], answers[j]])

        def run(block: Block | None, driven: Sequence[Any]) -> Sequence[Any]:
            loads_of = [by_name[name] for name in block.scheduling] if block else []
            return block.wired(board, [*driven, *loads_of]) if block else driven

        desired, measured = run(behind, taken[:m]), run(behind, answers)
        loads = [by_name[name] for name in self.core.fixed.scheduling]
        signals = run(before, self.core.wired(board, [*desired, *loads, *measured]))
        if not isinstance(self.start, str):
            board.resume(self.start)
        return [*signals]

    def report(self, state: Array) -> None:
        if self.parts:
            super().report(state)
        else:
            self.fixed.report(state[: self.fixed.n_states])

    @property
    def clip_counts(self) -> tuple[int, ...]:
        return super().clip_counts if self.parts else self.fixed.clip_counts

    # -- present model ------------------------------------------------------------------------

    def present(self, state: Array) -> Block:
        """Return the forward block with the parameters of a state, shape (n_states,)."""
        learned_block = self.learnable.with_parameters(self._split(self._core_state(state))[2])
        before, _, behind = learning_part(self.forward)
        return (
            Series((*before, learned_block, *behind))
            if isinstance(self.forward, Series)
            else learned_block
        )

    def equations(self) -> tuple[str, ...]:
        return (
            r"\hat{u}_t = P_{\theta_t}^{-1}[y]_t",
            r"\theta_t = \Pi\left(\theta_{t-1} + \frac{C \varphi}{1 + \varphi^T C \varphi}\, e_t"
            r"\right),\quad e_t = y_{m,t} - P_{\theta_{t-1}}[\hat{u}]_{t-1}",
        )

    @classmethod
    def example(cls) -> Self:
        from mckibben.blocks.hysteresis.pi import PI

        return cls(PI.example(), 60.0, 0.05)


def adaptive(model: Block, time: float, noise: float | None = None) -> Adaptive:
    """Return the adaptive inverse of a model.

    Parameters
    ----------
    model : Block
        One with a single adaptive part: pi, gpi, mpi, cpi, balance.
    time : float
        Adaptation time [s].
    noise : float, optional
        Standard deviation of the measurement noise [unit of the output]; default is a thousandth of the
        reachable range.

    Raises
    ------
    ModelError
        If no part of the model can adapt, or it has no inverse.
    """
    if isinstance(model, Adaptive):
        raise ModelError(
            f"{model.title!r} adapts already",
            remedy="use it as it is, or adapt the model that it inverts",
        )
    _, part, behind = learning_part(model)
    width = width_of((part, *behind))
    if noise is None and not 0 < width < np.inf:
        raise ModelError(
            f"the range of {model.title!r}, of which noise is a share by default, is unknown",
            remedy="give `noise`",
        )
    return Adaptive(model, float(time), float(width / 1000 if noise is None else noise))

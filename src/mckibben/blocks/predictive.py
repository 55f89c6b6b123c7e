"""Model-predictive compensators with limits of pressure and its rate.

In every sample the exact inverse runs over the references of a horizon, from the model's present state.
If its pressures are within all limits, they are the output: then this is the exact inverse. Otherwise
all pressures of the horizon are optimised together (`mckibben.blocks.planning`), with the model as
prediction, hysteresis included; the first of them is the output, and the model advances by it. So a
reversal that is too fast for the supply starts early, and the error is shared before and after.

References arrive ``horizon - 1`` samples ahead, one a sample, and are stored until they are due.

Kernels are written in the subset of Python of docs/kernels.md; fields are in the order of saved files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from annotated_types import Gt, Interval, Le
from pydantic import BeforeValidator, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Advance, Block, Start
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.fields import STRICT, Initial, drives
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.kernels import Step, fill, in_scratch, kernel, step
from mckibben.blocks.parameters import same_as, with_parts
from mckibben.blocks.planning import clip_path, plan_path, plan_scratch
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.blocks.saving import nested
from mckibben.blocks.starts import stated
from mckibben.errors import ModelError

NUDGE = 1e-3
"""Step of pressure for slopes of the model, relative to the pressure range."""

FASTEST = 1e6
"""Largest limit [bar/s]."""

HEAD = 7
(
    N_PRESSURES,
    HORIZON,
    N_MODEL_STATES,
    N_INVERSE_STATES,
    N_MODEL_COEFFICIENTS,
    N_INVERSE_COEFFICIENTS,
    N_REFERENCES,
) = range(HEAD)
"""Places of the coefficients before the pressure steps: all are sizes."""

PASSES = 2
"""Optimisations in a sample: the first is linearised about the pressures without limits, the second
about the result of the first.
"""

UNCHANGED = 0.1
"""Motion, relative to the pressure step, that counts as unchanged."""

Limit = Annotated[FiniteFloat, Gt(0), Le(FASTEST)]


# -- the memory that a model and its inverse share -------------------------------------------------


def model_state_of(compensator: Block, state: Array) -> Array:
    """Return the model's state from a compensator's.

    Raises
    ------
    ModelError
        If the compensator is no exact inverse, or its state does not determine the model's.
    """
    match compensator:
        case Inverse() if compensator.n_states >= compensator.forward.n_states:
            return state[: compensator.forward.n_states].copy()
        case Series() | PerChannel():
            parts = compensator.parts
            shares = np.split(state, np.cumsum([part.n_states for part in parts])[:-1])
            states = [
                model_state_of(part, share) for part, share in zip(parts, shares, strict=True)
            ]
            return np.concatenate(states[:: -1 if isinstance(compensator, Series) else 1])
    if isinstance(compensator, Balance) or compensator.n_states == 0:
        return state.copy()
    raise ModelError(
        f"{compensator.title!r} is not an exact inverse, so its state cannot be predicted",
        remedy="invert a model such as pi, gpi, mpi or balance with `invert()`, and give that",
    )


def without_dead_time(block: Any) -> Any:
    """Return a block without its dead times, which its inverse does not compensate."""

    def undelayed(part: Any) -> Any:
        delayed = "dead_time" in part.__dataclass_fields__ and part.dead_time > 0
        return replace(part, dead_time=0.0) if delayed else part

    return with_parts(block, undelayed)


def inverse_state_of(compensator: Block) -> Callable[[Array], Array]:
    """Return the kernel that converts a model's state to its compensator's."""
    match compensator:
        case Inverse():
            return compensator.forward.inverse_state
        case Series() | PerChannel():
            order = -1 if isinstance(compensator, Series) else 1
            parts = compensator.parts[::order]  # in the order of the model
            converters = [inverse_state_of(part) for part in parts]
            ends = np.cumsum([part.inverse().n_states for part in parts])[:-1]

            def joined(memory: Array) -> Array:
                states = zip(converters, np.split(memory, ends), strict=True)
                return np.concatenate([convert(state) for convert, state in states][::order])

            return joined
    return np.copy


Resume = Callable[[Array, Array, Array], None]


@kernel
def pi_resume(coefficients: Array, memory: Array, state: Array) -> None:
    """Set the state of a PI model's inverse from the model's."""
    n, y = memory.size, 0.0
    for i in range(n):
        state[i] = memory[i]
        y += coefficients[1 + n + i] * memory[i]
    state[n] = coefficients[0] + y
    state[n + 1] = 0.0


@kernel
def gpi_resume(coefficients: Array, memory: Array, state: Array) -> None:
    """Set the state of a GPI model's inverse from the model's."""
    n, y = memory.size - 1, 0.0
    for i in range(n):
        state[i] = memory[i]
        y += coefficients[1 + n + i] * memory[i]
    state[n], state[n + 1], state[n + 2] = memory[n], y, 0.0


@kernel
def same_resume(coefficients: Array, memory: Array, state: Array) -> None:
    """Copy the model's state."""
    fill(state, memory)


def resume_of(compensator: Block) -> Resume | None:
    """Return the kernel that sets a compensator's state from its model's; None if there is none."""
    match compensator:
        case Inverse(forward=PI()):
            return pi_resume
        case Inverse(forward=GPI()):
            return gpi_resume
        case Balance():
            return same_resume
    return None


# -- its kernel ------------------------------------------------------------------------------------


def with_scratch_argument(function: Any) -> Any:
    """Return a step with a working-memory argument, whether it needs one or not."""

    @kernel
    def without_scratch(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Advance a step that needs no working memory."""
        function(coefficients, state, inputs, outputs)

    return function if in_scratch(function) else without_scratch


def start_with_scratch_argument(function: Any) -> Any:
    """Return a start with a working-memory argument, whether it needs one or not."""

    @kernel
    def start_without_scratch(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
    ) -> None:
        """Advance a start that needs no working memory."""
        function(coefficients, state, inputs, virgin)

    return function if in_scratch(function) else start_without_scratch


@cache
def predictive_kernels(
    model_step: Step, inverse_step: Step, inverse_start: Start, resume: Resume
) -> tuple[Step, Start]:
    """Return step and start of a predictive compensator.

    They are composed of the kernels of a model and of its inverse; ``resume`` fills the inverse's state
    from the model's. Coefficients are [n, horizon, the model's states, the inverse's, the model's
    coefficients, the inverse's, references m], nudges (n), limits (1 + 2 n), and the coefficients of
    both. The state is [the model's, references to come (horizon by m), last pressures (n), whether there
    are some, plans made]. The working memory is [three states of the model, the inverse's state, the
    inverse's inputs, the model's inputs, path ((1 + horizon) n), nominal path (the same), slopes
    (horizon m by n), errors (horizon m), vectors (n + 2 m), the working memory of other kernels].
    """
    run_model, run_inverse, start_inverse = (
        with_scratch_argument(model_step),
        with_scratch_argument(inverse_step),
        start_with_scratch_argument(inverse_start),
    )
    predictive_step = step_of(run_model, run_inverse, resume, decorate=kernel)

    @kernel
    def predictive_start(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
    ) -> None:
        """Start as the inverse does: as if its first reference had always been applied."""
        c = coefficients
        inverse_state = scratch[: int(c[N_INVERSE_STATES])]
        inverse = c[HEAD + 1 + 3 * int(c[N_PRESSURES]) + int(c[N_MODEL_COEFFICIENTS]) :]
        start_inverse(inverse, inverse_state, scratch[inverse_state.size :], inputs, virgin)
        state[:] = 0.0
        fill(state[: int(c[N_MODEL_STATES])], inverse_state)

    return step(predictive_step), predictive_start


def step_of(
    run_model: Any, run_inverse: Any, resume: Any, *, decorate: Callable[[Any], Any]
) -> Callable[..., None]:
    """Return the step of `predictive_kernels`, uncompiled; its callees are compiled, or decorated.

    For a model of several kernels, ``run_model``, ``run_inverse`` and ``resume`` are not compiled.
    """

    @decorate
    def linearise(
        n: int,
        model: Array,
        nudges: Array,
        model_state: Array,
        references: Array,
        path: Array,
        model_inputs: Array,
        tables: Array,
        states: Array,
        kernel_scratch: Array,
    ) -> None:
        """Compute the errors along a path, and the model's slopes where the motion continues.

        ``tables`` become [slopes, errors]; they are followed by three vectors to compute in.
        """
        size, length, count = model_state.size, path.size // n - 1, references.size
        m = count // length
        trial, before_sample = states[:size], states[size : 2 * size]
        after_sample = states[2 * size : 3 * size]
        slopes, errors = tables[: n * count], tables[n * count : (n + 1) * count]
        vectors = tables[(n + 1) * count :]
        direction, outputs = vectors[:n], vectors[n : n + m]
        nudged_outputs = vectors[n + m : n + 2 * m]

        direction[:] = 1.0
        fill(before_sample, model_state)
        for t in range(length):
            for k in range(n):
                p = path[(t + 1) * n + k]
                motion = p - path[t * n + k]
                if abs(motion) > UNCHANGED * nudges[k]:
                    direction[k] = 1.0 if motion > 0.0 else -1.0
                model_inputs[k] = p

            fill(trial, before_sample)
            run_model(model, trial, kernel_scratch, model_inputs, outputs)
            fill(after_sample, trial)

            for k in range(n):
                model_inputs[k] = path[(t + 1) * n + k] + direction[k] * nudges[k]
                fill(trial, before_sample)
                run_model(model, trial, kernel_scratch, model_inputs, nudged_outputs)
                for i in range(m):
                    change = nudged_outputs[i] - outputs[i]
                    slopes[(t * m + i) * n + k] = change / (direction[k] * nudges[k])
                model_inputs[k] = path[(t + 1) * n + k]

            for i in range(m):
                errors[t * m + i] = references[t * m + i] - outputs[i]
            fill(before_sample, after_sample)

    def predictive_step(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Compute the first pressures of a horizon within all limits, and take that step."""
        c = coefficients
        n, m, length = int(c[N_PRESSURES]), int(c[N_REFERENCES]), int(c[HORIZON])
        size, n_inverse = int(c[N_MODEL_STATES]), int(c[N_INVERSE_STATES])
        n_model_coefficients = int(c[N_MODEL_COEFFICIENTS])
        planned, count = length * n, length * m
        nudges, limits = c[HEAD : HEAD + n], c[HEAD + n : HEAD + 3 * n + 1]
        both_coefficients = c[HEAD + 3 * n + 1 :]
        model = both_coefficients[:n_model_coefficients]
        first_after = n_model_coefficients + int(c[N_INVERSE_COEFFICIENTS])
        inverse = both_coefficients[n_model_coefficients:first_after]
        model_state, references = state[:size], state[size : size + count]
        last = state[size + count :]

        first_inverse_input = 3 * size + n_inverse
        first_model_input = first_inverse_input + inputs.size
        first_of_path = first_model_input + inputs.size - m + n
        first_nominal = first_of_path + n + planned
        first_slope = first_nominal + n + planned
        first_of_kernels = first_slope + (n + 1) * count + n + 2 * m
        states, inverse_state = scratch[: 3 * size], scratch[3 * size : first_inverse_input]
        inverse_inputs = scratch[first_inverse_input:first_model_input]
        model_inputs = scratch[first_model_input:first_of_path]
        path, nominal = scratch[first_of_path:first_nominal], scratch[first_nominal:first_slope]
        tables, kernel_scratch = scratch[first_slope:first_of_kernels], scratch[first_of_kernels:]

        # shift the queue of references
        first = last[n] == 0.0
        for i in range(count - m):
            references[i] = inputs[i % m] if first else references[i + m]
        fill(references[count - m :], inputs[:m])

        # the inverse over the horizon
        resume(model, model_state, inverse_state)
        fill(inverse_inputs, inputs)
        fill(model_inputs[n:], inputs[m:])
        for t in range(length):
            fill(inverse_inputs[:m], references[t * m : (t + 1) * m])
            pressures = path[(t + 1) * n : (t + 2) * n]
            run_inverse(inverse, inverse_state, kernel_scratch, inverse_inputs, pressures)

        # the first sample has no rate
        if first:
            for k in range(n):
                last[k] = min(max(path[n + k], limits[1 + k]), limits[1 + n + k])
            last[n] = 1.0
        fill(path[:n], last[:n])
        fill(nominal, path)

        # plan, where a limit acts within the horizon
        if not clip_path(limits, path):
            slopes, errors = tables[: n * count], tables[n * count : (n + 1) * count]
            for _ in range(PASSES):
                linearise(
                    n,
                    model,
                    nudges,
                    model_state,
                    references,
                    nominal,
                    model_inputs,
                    tables,
                    states,
                    kernel_scratch,
                )
                _ = plan_path(limits, slopes, nominal[n:], errors, path, kernel_scratch)
                _ = clip_path(limits, path)
                fill(nominal, path)
            last[n + 1] += 1.0

        # apply the first pressures
        fill(last[:n], path[n : 2 * n])
        fill(model_inputs[:n], last[:n])
        run_model(model, model_state, kernel_scratch, model_inputs, inverse_inputs[:m])
        fill(outputs, last[:n])

    return predictive_step


def one_step_of(block: Block, sample_time: float) -> Callable[..., None]:
    """Return a step that runs a block of several kernels."""
    own_state = np.empty(block.n_states)
    own_inputs, own_outputs = np.empty((1, len(block.inputs))), np.empty((1, len(block.outputs)))
    run = block.bind(sample_time, own_state, own_inputs, own_outputs)

    def run_model(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        del coefficients, scratch
        own_state[:], own_inputs[0] = state, inputs
        run()
        state[:], outputs[:] = own_state, own_outputs[0]

    return run_model


@dataclass(frozen=True, config=STRICT)
class Predictive(Block):
    """Compensator with limits, optimised over a horizon.

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
    """

    kind = "predictive"
    inverts = True
    parameters = ("compensator",)
    retired: ClassVar[Mapping[str, Any]] = {"total_limit": None, "flow_limit": None, "volumes": ()}
    rate_dependent = True
    path_dependent = True
    formulas = (
        r"\min_{p} \sum_{t=0}^{N-1} \left(r_t - P[p]_t\right)^2 \quad\text{such that}\quad "
        r"p_{\min} \le p_t \le p_{\max},\quad |p_t - p_{t-1}| \le \rho T",
    )

    compensator: Annotated[InstanceOf[Block], BeforeValidator(nested)]
    horizon: Annotated[int, Interval(ge=1, le=200)] = 20
    rate_limit: Annotated[Limit | None, r"\rho [bar/s]"] = None
    pressure_range: tuple[FiniteFloat, FiniteFloat] | None = None

    inputs = same_as("compensator.inputs")
    scheduling = same_as("compensator.scheduling")
    outputs = same_as("compensator.outputs")

    def __post_init__(self) -> None:
        model_state_of(self._inverse, np.zeros(self._inverse.n_states))
        if strange := [c.name for c in self.outputs if not drives(c)]:
            raise ModelError(
                f"{self.kind!r} plans commands of muscles, and the outputs of "
                f"{self.compensator.title!r} are {', '.join(strange)}",
                remedy="give the compensator, from references to pressures",
            )
        low, high = self.pressures
        if not (np.isfinite([*low, *high]).all() and (low < high).all()):
            raise ModelError(
                f"{self.kind!r} plans pressures between {low.tolist()} and {high.tolist()} bar",
                remedy="give pressure_range, the lower end first",
            )

    @cached_property
    def forward_model(self) -> Block:
        """The inverted model: from pressures to displacements."""
        return self.compensator.inverse()

    @cached_property
    def _inverse(self) -> Block:
        """The compensator of the model without dead times."""
        return without_dead_time(self.compensator)

    @cached_property
    def _planned(self) -> Block:
        """The model used for prediction."""
        return self._inverse.inverse()

    @cached_property
    def pressures(self) -> tuple[Array, Array]:
        """Lowest and highest pressure of every muscle [bar], shape (n,) each."""
        if self.pressure_range is None:
            return self.compensator.reachable()
        low, high = self.pressure_range
        return np.full(len(self.outputs), low), np.full(len(self.outputs), high)

    @property
    def samples_ahead(self) -> int:  # type: ignore[override]
        return self.horizon - 1

    @property
    def n_states(self) -> int:
        """States: the model's, future references, last pressures and their validity, plan counter."""
        n, m = len(self.outputs), self.compensator.n_driven
        return self._planned.n_states + self.horizon * m + n + 2

    def initial_state(
        self, first: Array, initial: Initial | None = None, sample_time: float | None = None
    ) -> Array:
        if initial is not None and not isinstance(initial, str):
            return stated(self.kind, self.n_states, initial)
        model_state = model_state_of(
            self._inverse, self._inverse.initial_state(first, initial, sample_time)
        )
        return np.concatenate([model_state, np.zeros(self.n_states - model_state.size)])

    @property
    def clip_counts(self) -> tuple[int, ...]:
        """Place of the count of plans: samples in which a limit acts within the horizon."""
        return (self.n_states - 1,)

    @property
    def start(self) -> Initial:
        return self.compensator.start if isinstance(self.compensator.start, str) else "first_sample"

    @property
    def n_scratch(self) -> int:
        """Length of the working memory, laid out as in `predictive_kernels`."""
        model, inverse = self._planned, self._inverse
        n, m = len(self.outputs), inverse.n_driven
        states = 3 * model.n_states + inverse.n_states
        inputs = len(inverse.inputs) + len(model.inputs)
        paths = 2 * (1 + self.horizon) * n
        tables = self.horizon * m * (n + 1) + n + 2 * m
        kernels = max(plan_scratch(self.horizon), model.n_scratch, inverse.n_scratch)
        return states + inputs + paths + tables + kernels

    @cached_property
    def _kernels(self) -> tuple[Step, Start] | None:
        """Kernels of a compensator of one kernel; None for several."""
        resume = resume_of(self._inverse)
        if resume is None or not isinstance(self.compensator.start, str):
            return None
        (inverse_step, inverse_start), (model_step, _) = (
            self._inverse.c_kernels,
            self._planned.c_kernels,
        )
        return predictive_kernels(model_step, inverse_step, inverse_start, resume)

    @property
    def kernel(self) -> Step | None:  # type: ignore[override]
        return self._kernels and self._kernels[0]

    @property
    def start_kernel(self) -> Start | None:  # type: ignore[override]
        return self._kernels and self._kernels[1]

    def coefficients(self, sample_time: float | None) -> Array:
        if self._kernels is None:
            raise ModelError(
                f"{self.compensator.title!r} cannot be simulated ahead in C",
                remedy="export pi, gpi or balance that starts at its first sample, or "
                "stream this one from Python",
            )
        blocks = (self._planned, self._inverse)
        return self._numbers(sample_time, [block.coefficients(sample_time) for block in blocks])

    def _numbers(self, sample_time: float | None, own: list[Array]) -> Array:
        """Return the coefficients, with those of the model and the inverse."""
        low, high = self.pressures
        rate = np.inf if self.rate_limit is None else self.rate_limit
        change = rate * needs_sample_time(self.kind, sample_time)
        sizes = [self._planned.n_states, self._inverse.n_states, *map(len, own)]
        head = [len(low), self.horizon, *sizes, self.compensator.n_driven]
        return np.concatenate([head, NUDGE * (high - low), [change], low, high, *own])

    def bind(
        self, sample_time: float | None, state: Array, inputs: Array, outputs: Array
    ) -> Advance:
        if self._kernels is not None:
            return super().bind(sample_time, state, inputs, outputs)
        numbers = self._numbers(sample_time, [np.empty(0), np.empty(0)])
        scratch, state_of_inverse = np.empty(self.n_scratch), inverse_state_of(self._inverse)
        own_time = needs_sample_time(self.kind, sample_time)
        run_model, run_inverse = (one_step_of(b, own_time) for b in (self._planned, self._inverse))

        def resume(model: Array, memory: Array, own: Array) -> None:
            del model
            own[:] = state_of_inverse(memory)

        advance = step_of(run_model, run_inverse, resume, decorate=lambda function: function)

        def run() -> None:
            for t in range(len(inputs)):
                advance(numbers, state, scratch, inputs[t], outputs[t])

        return run

    @classmethod
    def example(cls) -> Self:
        return cls(PI.example().inverse(), horizon=8, rate_limit=10.0)

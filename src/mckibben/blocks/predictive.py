"""Model-predictive compensators with limits of pressure and its rate.

In every sample the exact inverse runs over the references of a horizon, from the model's present state.
If its pressures are within all limits, they are the output: then this is the exact inverse. Otherwise
all pressures of the horizon are optimised together (`mckibben.blocks.planning`), with the model as
prediction, hysteresis included; the first of them is the output, and the model advances by it. So a
reversal that is too fast for the supply start_inverse early, and the error is shared before and after.

References arrive ``horizon - 1`` samples ahead, one a sample, and are stored until they are due.
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
N_PRESSURES, HORIZON, STATES, INVERSE_STATES, NUMBERS, INVERSE_NUMBERS, N_REFERENCES = range(HEAD)
"""Places of the coefficients before the pressure steps: all are sizes."""

PASSES = 2
"""Number of optimisations per sample, each linearised about the result of the last."""

UNCHANGED = 0.1
"""Motion, relative to the pressure step, that counts as unchanged."""

Limit = Annotated[FiniteFloat, Gt(0), Le(FASTEST)]


# -- the memory that a model and its inverse share -------------------------------------------------


def model_state(compensator: Block, state: Array) -> Array:
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
            found = [model_state(part, own) for part, own in zip(parts, shares, strict=True)]
            return np.concatenate(found[:: -1 if isinstance(compensator, Series) else 1])
    if isinstance(compensator, Balance) or compensator.n_states == 0:
        return state.copy()
    raise ModelError(
        f"{compensator.title!r} is not an exact inverse, so its state cannot be predicted",
        remedy="invert a model such as pi, gpi, mpi or balance with `invert()`, and give that",
    )


def without_dead_time(block: Any) -> Any:
    """Return a block without its dead times, which its inverse does not compensate."""

    def prompt(part: Any) -> Any:
        late = "dead_time" in part.__dataclass_fields__ and part.dead_time > 0
        return replace(part, dead_time=0.0) if late else part

    return with_parts(block, prompt)


def inverse_state_of(compensator: Block) -> Callable[[Array], Array]:
    """Return the kernel that converts a model's state to its compensator's."""
    match compensator:
        case Inverse():
            return compensator.forward.inverse_state
        case Series() | PerChannel():
            turn = -1 if isinstance(compensator, Series) else 1
            parts = compensator.parts[::turn]  # in the order of the model
            ways = [inverse_state_of(part) for part in parts]
            ends = np.cumsum([part.inverse().n_states for part in parts])[:-1]

            def joined(memory: Array) -> Array:
                shares = zip(ways, np.split(memory, ends), strict=True)
                return np.concatenate([way(share) for way, share in shares][::turn])

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


def _in_room(function: Any) -> Any:
    """Return a step with a working-memory argument, whether it needs one or not."""

    @kernel
    def without_scratch(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Advance a step that needs no working memory."""
        function(coefficients, state, inputs, outputs)

    return function if in_scratch(function) else without_scratch


def _start_in_room(function: Any) -> Any:
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
    are some, plans made].
    """
    run_model, run_inverse, start_inverse = (
        _in_room(model_step),
        _in_room(inverse_step),
        _start_in_room(inverse_start),
    )
    predictive_step = step_of(run_model, run_inverse, resume, decorate=kernel)

    @kernel
    def predictive_start(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
    ) -> None:
        """Start as the inverse does: as if its first reference had always been applied."""
        c = coefficients
        inverse_state = scratch[: int(c[INVERSE_STATES])]
        numbers = c[HEAD + 1 + 3 * int(c[N_PRESSURES]) + int(c[NUMBERS]) :]
        start_inverse(numbers, inverse_state, scratch[inverse_state.size :], inputs, virgin)
        state[:] = 0.0
        fill(state[: int(c[STATES])], inverse_state)

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
        memory: Array,
        desired: Array,
        path: Array,
        given: Array,
        tables: Array,
        states: Array,
        room: Array,
    ) -> None:
        """Compute the errors along a path, and the model's slopes where the motion continues.

        ``tables`` become [slopes, errors]; they are followed by three vectors to compute in.
        """
        size, length, count = memory.size, path.size // n - 1, desired.size
        m = count // length
        trial, kept, after = states[:size], states[size : 2 * size], states[2 * size : 3 * size]
        slopes, errors = tables[: n * count], tables[n * count : (n + 1) * count]
        vectors = tables[(n + 1) * count :]
        way, answer, change = vectors[:n], vectors[n : n + m], vectors[n + m : n + 2 * m]
        way[:] = 1.0
        fill(kept, memory)
        for t in range(length):
            for k in range(n):
                p = path[(t + 1) * n + k]
                moved = p - path[t * n + k]
                if abs(moved) > UNCHANGED * nudges[k]:
                    way[k] = 1.0 if moved > 0.0 else -1.0
                given[k] = p
            fill(trial, kept)
            run_model(model, trial, room, given, answer)
            fill(after, trial)
            for k in range(n):
                given[k] = path[(t + 1) * n + k] + way[k] * nudges[k]
                fill(trial, kept)
                run_model(model, trial, room, given, change)
                for i in range(m):
                    slopes[(t * m + i) * n + k] = (change[i] - answer[i]) / (way[k] * nudges[k])
                given[k] = path[(t + 1) * n + k]
            for i in range(m):
                errors[t * m + i] = desired[t * m + i] - answer[i]
            fill(kept, after)

    def predictive_step(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Compute the first pressures of a horizon within all limits, and take that step."""
        c = coefficients
        n, m, length = int(c[N_PRESSURES]), int(c[N_REFERENCES]), int(c[HORIZON])
        size, n_inverse, own_size = int(c[STATES]), int(c[INVERSE_STATES]), int(c[NUMBERS])
        planned, count = length * n, length * m
        nudges, limits = c[HEAD : HEAD + n], c[HEAD + n : HEAD + 3 * n + 1]
        own = c[HEAD + 3 * n + 1 :]
        model, inverse = own[:own_size], own[own_size : own_size + int(c[INVERSE_NUMBERS])]
        memory, desired, last = state[:size], state[size : size + count], state[size + count :]
        states, inverse_state = scratch[: 3 * size], scratch[3 * size : 3 * size + n_inverse]
        more = scratch[3 * size + n_inverse :]
        asked, given = more[: inputs.size], more[inputs.size : 2 * inputs.size - m + n]
        rest = more[2 * inputs.size - m + n :]
        path, nominal = rest[: n + planned], rest[n + planned : 2 * (n + planned)]
        tables = rest[2 * (n + planned) : 2 * (n + planned) + (n + 1) * count + n + 2 * m]
        room = rest[2 * (n + planned) + (n + 1) * count + n + 2 * m :]
        first = last[n] == 0.0
        for i in range(count - m):
            desired[i] = inputs[i % m] if first else desired[i + m]
        fill(desired[count - m :], inputs[:m])
        resume(model, memory, inverse_state)
        fill(asked, inputs)
        fill(given[n:], inputs[m:])
        for t in range(length):
            fill(asked[:m], desired[t * m : (t + 1) * m])
            run_inverse(inverse, inverse_state, room, asked, path[(t + 1) * n : (t + 2) * n])
        if first:  # whatever the rate
            for k in range(n):
                last[k] = min(max(path[n + k], limits[1 + k]), limits[1 + n + k])
            last[n] = 1.0
        fill(path[:n], last[:n])
        fill(nominal, path)
        if not clip_path(limits, path):
            slopes, errors = tables[: n * count], tables[n * count : (n + 1) * count]
            for _ in range(PASSES):
                linearise(n, model, nudges, memory, desired, nominal, given, tables, states, room)
                _ = plan_path(limits, slopes, nominal[n:], errors, path, room)
                _ = clip_path(limits, path)
                fill(nominal, path)
            last[n + 1] += 1.0
        fill(last[:n], path[n : 2 * n])
        fill(given[:n], last[:n])
        run_model(model, memory, room, given, asked[:m])
        fill(outputs, last[:n])

    return predictive_step


def one_step_of(block: Block, sample_time: float) -> Callable[..., None]:
    """Return a step that runs a block of several kernels."""
    state = np.empty(block.n_states)
    given, found = np.empty((1, len(block.inputs))), np.empty((1, len(block.outputs)))
    run = block.bind(sample_time, state, given, found)

    def run_model(
        numbers: Array, memory: Array, room: Array, inputs: Array, outputs: Array
    ) -> None:
        del numbers, room
        state[:], given[0] = memory, inputs
        run()
        memory[:], outputs[:] = state, found[0]

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
        model_state(self._inverse, np.zeros(self._inverse.n_states))
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
        own = model_state(self._inverse, self._inverse.initial_state(first, initial, sample_time))
        return np.concatenate([own, np.zeros(self.n_states - own.size)])

    @property
    def clip_counts(self) -> tuple[int, ...]:
        """Place of the count of plans: samples in which a limit acts within the horizon."""
        return (self.n_states - 1,)

    @property
    def start(self) -> Initial:
        return self.compensator.start if isinstance(self.compensator.start, str) else "first_sample"

    @property
    def n_scratch(self) -> int:
        """Scratch: trial states, pressures, slopes, and the working memory of a plan."""
        model, inverse = self._planned, self._inverse
        n, m = len(self.outputs), inverse.n_driven
        given = len(model.inputs) + len(inverse.inputs)
        own = 3 * model.n_states + inverse.n_states + given + 2 * n + n + 2 * m
        room = max(plan_scratch(self.horizon), model.n_scratch, inverse.n_scratch)
        return own + self.horizon * (2 * n + m * (1 + n)) + room

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

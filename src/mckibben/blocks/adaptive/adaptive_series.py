"""An inverse in series of which one part learns: mpi, cpi and their kin.

Parts behind the one that learns are undone on what is measured as on the reference, each with a memory
of its own; parts before it are undone on what the inverse gives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt
from pydantic import BeforeValidator, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.adaptive.adaptable import Adaptable
from mckibben.blocks.adaptive.adaptive import Adaptive, check_settings, learner_of, told_width
from mckibben.blocks.adaptive.drift import Drift
from mckibben.blocks.base import Block, Board, Run
from mckibben.blocks.compose import Composition, Series
from mckibben.blocks.feedback.pid import MEASURED
from mckibben.blocks.fields import STRICT, Channel, Initial, Vector
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError


@dataclass(frozen=True, config=STRICT)
class AdaptiveSeries(Composition):
    """The inverse of a series, one part of which learns while it runs.

    Parameters
    ----------
    forward : Series
        Of blocks of one channel, exactly one of which declares what of it is learnt.
    time : float
        How long it takes to learn what the motion shows [s]; positive.
    noise : float
        Standard deviation of what is measured [unit of the output].
    memory : sequence of float, optional
        State to go on from, as `resumed` keeps it.
    """

    kind: ClassVar[str] = "adaptive-series"
    rate_dependent: ClassVar[bool] = True
    parameters: ClassVar[tuple[str, ...]] = ("forward",)

    forward: Annotated[InstanceOf[Series], BeforeValidator(nested)]
    time: Annotated[FiniteFloat, Gt(0)]
    noise: Annotated[FiniteFloat, Gt(0)]
    memory: Vector | None = None

    def __post_init__(self) -> None:
        learning = sum(learner_of(part) is not None for part in self.forward.parts)
        single = all(len(part.inputs) == 1 == len(part.outputs) for part in self.forward.parts)
        if learning != 1 or not single:
            raise ModelError(
                f"{learning} parts of this series can learn. Remedy: adapt pi, gpi, mpi, cpi or "
                "balance models: one part that learns, of one channel like the others."
            )
        check_settings(
            self.kind, self.time, self.noise, told_width(self.forward, self.core.learner)
        )
        if self.memory is None or self._learnt is not None:
            return
        if len(self.memory) != self.n_states:
            raise ModelError(
                f"the memory of {self.kind!r} has {len(self.memory)} numbers, its state "
                f"{self.n_states}. Remedy: resume what was saved with the same model."
            )
        state = np.array(self.memory)
        self.core.check_memory(self._core_state(state))
        for part, own in zip(self.parts, self._states(state), strict=True):
            if part is not self.core:
                part.initial_state(np.zeros(len(part.inputs)), own.tolist())

    @property
    def _learnt(self) -> Vector | None:
        """The memory, where that is what is learnt alone."""
        n = self.core.n_learnt
        return self.memory if self.memory is not None and len(self.memory) == n else None

    @cached_property
    def _place(self) -> int:
        parts = self.forward.parts
        return next(k for k, part in enumerate(parts) if learner_of(part) is not None)

    @cached_property
    def core(self) -> Adaptive:
        """The part that learns, its noise that of the output by the mean slope of parts behind it."""
        part = self.forward.parts[self._place]
        assert isinstance(part, Adaptable | Inverse)
        low, high = (float(end[0]) for end in part.reachable())
        ends = np.array([low]), np.array([high])
        for behind in self.forward.parts[self._place + 1 :]:
            ends = behind.passes(*ends)
        slope = float(np.abs(ends[1] - ends[0])[0]) / (high - low)
        slope = slope if 0 < slope < np.inf else 1.0
        core = Adaptive(part, self.time, self.noise / slope)
        learnt = self.memory is not None and len(self.memory) == core.n_learnt
        return replace(core, memory=self.memory) if learnt else core

    @cached_property
    def parts(self) -> tuple[Block, ...]:  # type: ignore[override]
        """Parts behind undone on the reference, the same on what is measured, the core, those before."""
        parts = self.forward.parts
        behind = tuple(part.inverse() for part in reversed(parts[self._place + 1 :]))
        before = tuple(part.inverse() for part in reversed(parts[: self._place]))
        around = (Series(behind), Series(behind)) if behind else ()
        return (*around, self.core, *((Series(before),) if before else ()))

    @cached_property
    def _split_parts(self) -> tuple[Block | None, Block | None]:
        """What undoes parts behind and before, where there are any."""
        has_behind = self._place + 1 < len(self.forward.parts)
        return (self.parts[0] if has_behind else None, self.parts[-1] if self._place else None)

    @property
    def measured(self) -> tuple[Channel, ...]:
        """What is measured of the reference."""
        return tuple(Channel(f"{c.name}{MEASURED}", c.unit) for c in self.forward.outputs)

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """The reference, then what is measured."""
        return (*self.forward.outputs, *self.measured)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """What is measured."""
        return tuple(channel.name for channel in self.measured)

    @property
    def n_missable(self) -> int:
        """The measurement, where nothing behind remembers it."""
        behind = self._split_parts[0]
        return int(behind is None or behind.n_states == 0)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """The series' input."""
        return self.forward.inputs

    @property
    def start(self) -> Initial:
        """Memory to go on from, or every part's own start."""
        return "first_sample" if self._whole is None else self._whole

    @property
    def _whole(self) -> Vector | None:
        """The memory, where it is of all parts."""
        return None if self._learnt is not None else self.memory

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        initial = self._whole if initial is None else initial
        shares = iter(zip(self.parts, self._shared_initial(initial), strict=True))
        behind, before = self._split_parts
        states, core_sample = [], np.array(first[:2], dtype=np.float64)
        for k in range(2) if behind else ():
            part, own = next(shares)
            states.append(part.initial_state(core_sample[k : k + 1].copy(), own))
            core_sample[k] = _once(part, states[-1], core_sample[k : k + 1])[0]
        part, own = next(shares)
        states.append(part.initial_state(core_sample, own))
        if before:
            given = _once(part, states[-1], core_sample)
            part, own = next(shares)
            states.append(part.initial_state(given, own))
        return np.concatenate(states)

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that undoes the parts in order."""
        n = inputs.shape[0]
        behind, before = self._split_parts
        columns = [np.empty((n, 1)) for _ in range(4)]
        undone, given = np.empty((n, 2)), np.empty((n, 1)) if before else outputs
        states = iter(self._states(state))
        runs: list[Run] = []
        if behind:
            for k in range(2):
                runs.append(behind.bind(sample_time, next(states), columns[k], columns[2 + k]))
        learn = self.core.bind(sample_time, next(states), undone, given)
        last = before.bind(sample_time, next(states), given, outputs) if before else None

        def run() -> None:
            for k, undo in enumerate(runs):
                columns[k][:, 0] = inputs[:, k]
                undo()
                undone[:, k] = columns[2 + k][:, 0]
            if not runs:
                undone[:] = inputs
            learn()
            if last is not None:
                last()

        return run

    def wired(self, board: Board, given: Sequence[str]) -> list[str]:
        """Lay out the parts; those behind the core twice."""
        behind, before = self._split_parts
        signals = [behind.wired(board, [signal])[0] for signal in given] if behind else list(given)
        pressures = self.core.wired(board, signals)
        found = before.wired(board, pressures) if before else pressures
        if self.memory is not None:
            board.resume(self.memory)
        return found

    @property
    def undone(self) -> Block:
        """The forward series, as fitted."""
        return self.forward

    def reachable(self) -> tuple[Array, Array]:
        """Return what the inverse gives."""
        return self.forward.inverse().reachable()

    def _core_state(self, state: Array) -> Array:
        return self._states(state)[2 if self._split_parts[0] else 0]

    def present(self, state: Array) -> Series:
        """Return the forward series that the inverse runs with in a state, shape (n_states,)."""
        parts = list(self.forward.parts)
        parts[self._place] = self.core.present(self._core_state(state))
        return Series(tuple(parts))

    def drift(self, state: Array) -> Drift:
        """Return how far what is learnt has gone from the fit, in a state, shape (n_states,)."""
        return self.core.drift(self._core_state(state))

    def resumed(self, state: Array, memory: bool = True) -> Self:
        """Return this block, which goes on from a state when it is next started.

        Without ``memory`` of its hysteresis it keeps what is learnt alone: muscles were vented since.
        """
        numbers = np.asarray(state, dtype=np.float64)
        kept = numbers if memory else self._core_state(numbers)[-self.core.n_learnt :]
        return replace(self, memory=tuple(kept.tolist()))

    def joined(self, parts: Sequence[str]) -> str:
        """Return the parts around the one that learns."""
        behind, before = self._split_parts
        asked = f"{parts[0]}[y],\\, {parts[1]}[y_m]" if behind else "y,\\, y_m"
        core = rf"{parts[2 if behind else 0]}[{asked}]"
        return rf"\hat{{u}} = {parts[-1]}[{core}]" if before else rf"\hat{{u}} = {core}"

    @classmethod
    def example(cls) -> Self:
        return cls(Series.example(), 60.0, 0.05)


def _once(block: Block, state: Array, sample: Array) -> Array:
    """Return what a block gives for a first sample, its state left as it is."""
    outputs = np.empty((1, len(block.outputs)))
    block.bind(1.0, state.copy(), np.ascontiguousarray(sample)[np.newaxis], outputs)()
    return outputs[0]


def adaptive(model: Block, time: float, noise: float | None = None) -> Adaptive | AdaptiveSeries:
    """Return the inverse of a model that learns while it runs.

    Parameters
    ----------
    model : Block
        Of one part that can learn: pi, gpi, mpi, cpi, balance.
    time : float
        How long it takes to learn what the motion shows [s].
    noise : float, optional
        Standard deviation of what is measured [unit of the output]; default is a thousandth of what
        can be reached.

    Raises
    ------
    ModelError
        If nothing of the model can learn, or it has no inverse.
    """
    if isinstance(model, Adaptive | AdaptiveSeries):
        raise ModelError(
            f"{model.title!r} learns already. Remedy: use it as it is, or adapt the model it undoes."
        )
    parts = model.parts if isinstance(model, Series) else (model,)
    learner = next(filter(None, map(learner_of, parts)), None)
    if learner is None:
        raise ModelError(
            f"{model.title!r} cannot learn while it runs. Remedy: adapt a pi, gpi, mpi, cpi or balance "
            "model."
        )
    if noise is None:
        width = told_width(model, learner)
        if not 0 < width < np.inf:
            raise ModelError(
                f"what {model.title!r} reaches does not tell how exactly it is measured. "
                "Remedy: give the noise."
            )
        noise = width / 1000
    if isinstance(model, Series):
        return AdaptiveSeries(model, float(time), float(noise))
    assert isinstance(model, Adaptable | Inverse)
    return Adaptive(model, float(time), float(noise))

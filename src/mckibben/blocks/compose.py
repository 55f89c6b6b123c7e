"""Blocks made of blocks: in series, in parallel, and one to a channel.

They run, stream, save and invert because their parts do: the inverse of a series is the reversed
series of the inverses.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property, reduce
from itertools import pairwise
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Board, Run, explicit_state
from mckibben.blocks.fields import STRICT, Channel, Initial
from mckibben.blocks.linear import LinearSystem
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError
from mckibben.system.compiling import in_turn

DEEPEST, MOST_BLOCKS = 32, 1000
"""Compositions in compositions, and blocks in all."""


def _parts(value: object) -> object:
    return tuple(nested(part) for part in value) if isinstance(value, tuple | list) else value


Parts = Annotated[tuple[InstanceOf[Block], ...], BeforeValidator(_parts)]


class Composition(Block):
    """What all compositions share: states and parameters are those of the parts, one after another."""

    parameters: ClassVar[tuple[str, ...]] = ("parts",)
    together: ClassVar[Callable[[Iterable[float]], float]] = max  # of dead times side by side

    letter: ClassVar[str] = "P"  # of its parts in equations

    parts: tuple[Block, ...]

    def equations(self) -> tuple[str, ...]:
        """Return how the parts come together: ``y`` of them all, ``u`` going into each."""
        marks = [f"{self.letter}_{{{place + 1}}}" for place in range(len(self.parts))]
        return (self.joined(marks),)

    @abstractmethod
    def joined(self, parts: Sequence[str]) -> str:
        """Return in LaTeX what the parts, of these names, make together."""

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether any part is."""
        return any(part.rate_dependent for part in self.parts)

    @property
    def of_local_rules(self) -> bool:  # type: ignore[override]
        """Whether any part is."""
        return any(part.of_local_rules for part in self.parts)

    @property
    def depth(self) -> int:
        """How many compositions are in each other, this one included."""
        return 1 + max(getattr(part, "depth", 0) for part in self.parts)

    @property
    def n_blocks(self) -> int:
        """How many blocks it is made of, compositions included."""
        return 1 + sum(getattr(part, "n_blocks", 1) for part in self.parts)

    def check_parts(self) -> None:
        """Refuse no parts at all, and more, or more deeply nested ones, than a model is made of."""
        if not self.parts:
            raise ModelError(f"{self.kind!r} has no parts. Remedy: give at least one block.")
        if self.depth > DEEPEST or self.n_blocks > MOST_BLOCKS:
            raise ModelError(
                f"{self.kind!r} is nested {self.depth} deep and made of {self.n_blocks} blocks. "
                f"Remedy: compose at most {MOST_BLOCKS} blocks, at most {DEEPEST} deep."
            )

    @property
    def n_states(self) -> int:
        """The states of all parts."""
        return sum(part.n_states for part in self.parts)

    @property
    def n_scratch(self) -> int:
        """The scratch of all parts."""
        return sum(part.n_scratch for part in self.parts)

    @property
    def dead_time(self) -> float:  # type: ignore[override]
        """That of the parts together."""
        return type(self).together(part.dead_time for part in self.parts)

    def _states(self, state: Array) -> list[Array]:
        return np.split(state, np.cumsum([part.n_states for part in self.parts])[:-1])

    def report(self, state: Array) -> None:
        """Pass on what the parts have to say."""
        for part, share in zip(self.parts, self._states(state), strict=True):
            part.report(share)

    def n_clipped(self, state: Array) -> int:
        """Return those of all parts."""
        shares = zip(self.parts, self._states(state), strict=True)
        return sum(part.n_clipped(share) for part, share in shares)

    def _shared_initial(self, initial: Initial | None) -> Sequence[Initial | None]:
        """Return every part's own share of an explicit initial state, or the rule for all."""
        if initial is None or isinstance(initial, str):
            return [initial] * len(self.parts)
        return [share.tolist() for share in self._states(explicit_state(self, initial))]

    @property
    def undoing(self) -> bool:  # type: ignore[override]
        """Whether any part is an inverse: it reaches only what the block undone wants."""
        return any(part.undoing for part in self.parts)


AT_REST = ("first_sample", "fitted")
"""Rules by which a block starts at rest at its first input, where no output is known."""


@dataclass(frozen=True, config=STRICT)
class Series(Composition):
    """One block after another: the outputs of each drive the next.

    Scheduling inputs of later parts become inputs of the series.

    Parameters
    ----------
    parts : sequence of Block
        In the order of the signal; at least one.
    """

    kind: ClassVar[str] = "series"
    together: ClassVar[Callable[[Iterable[float]], float]] = sum

    parts: Parts

    def __post_init__(self) -> None:
        self.check_parts()
        for before, after in pairwise(self.parts):
            driven = len(after.inputs) - len(after.scheduling)
            if len(before.outputs) != driven:
                raise ModelError(
                    f"{before.kind!r} gives {len(before.outputs)} output(s), {after.kind!r} behind it "
                    f"wants {driven}. Remedy: connect blocks that fit."
                )

    @cached_property  # asked for at every level of a nested model
    def inputs(self) -> tuple[Channel, ...]:
        """Those of the first part, then scheduling inputs of later parts."""
        channels = {channel.name: channel for channel in self.parts[0].inputs}
        for part in self.parts[1:]:
            for channel in part.inputs[len(part.inputs) - len(part.scheduling) :]:
                channels.setdefault(channel.name, channel)
        return tuple(channels.values())

    @cached_property
    def scheduling(self) -> tuple[str, ...]:
        """Names of all scheduling inputs."""
        first = self.parts[0]
        driven = {c.name for c in first.inputs[: len(first.inputs) - len(first.scheduling)]}
        return tuple(c.name for c in self.inputs if c.name not in driven)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Those of the last part."""
        return self.parts[-1].outputs

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the parts' states, each started from the first sample that reaches it."""
        states: list[Array] = []
        driven: Array | None = None
        for part, own in zip(self.parts, self._shared_initial(initial), strict=True):
            sample = self._sample(part, first, driven)
            states.append(part.initial_state(sample, own))
            outputs = np.empty((1, len(part.outputs)))
            part.bind(part.sample_time or 1.0, states[-1].copy(), sample[np.newaxis], outputs)()
            driven = outputs[0]
        return np.concatenate(states)

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that runs the parts in order."""
        runs: list[Run] = []
        signal: Array | None = None
        last = len(self.parts) - 1
        for index, (part, own) in enumerate(zip(self.parts, self._states(state), strict=True)):
            given = inputs
            if signal is not None or len(part.inputs) < inputs.shape[1]:
                given, gather = self._gathered(part, inputs, signal)
                if gather is not None:
                    runs.append(gather)
            into = outputs if index == last else np.empty((inputs.shape[0], len(part.outputs)))
            runs.append(part.bind(sample_time, own, given, into))
            signal = into

        return in_turn(*runs)

    def _gathered(
        self, part: Block, inputs: Array, signal: Array | None
    ) -> tuple[Array, Run | None]:
        """Return the inputs of a part, and what fills them before it runs, if anything must."""
        names = [channel.name for channel in self.inputs]
        scheduling = [names.index(name) for name in part.scheduling]
        if signal is not None and not scheduling:
            return signal, None
        driven = len(part.inputs) - len(scheduling)
        gathered = np.empty((inputs.shape[0], len(part.inputs)))

        def gather() -> None:
            gathered[:, :driven] = inputs[:, :driven] if signal is None else signal
            for column, source in enumerate(scheduling, start=driven):
                gathered[:, column] = inputs[:, source]

        return gathered, gather

    def _sample(self, part: Block, first: Array, driven: Array | None) -> Array:
        signal = None if driven is None else driven[np.newaxis]
        given, gather = self._gathered(part, first[np.newaxis], signal)
        if gather is not None:
            gather()
        return given[0]

    def wired(self, board: Board, given: Sequence[str]) -> list[str]:
        """Lay out the parts one behind the other."""
        by_name = dict(zip((channel.name for channel in self.inputs), given, strict=True))
        signals: list[str] | None = None
        for number, part in enumerate(self.parts):
            at_rest = not part.rate_dependent or part.start in AT_REST
            if number < len(self.parts) - 1 and not at_rest:
                raise ModelError(
                    f"{part.kind!r} starts from a memory of its own and depends on the rate, so parts "
                    "behind it would start from another sample than in Python. Remedy: start it from "
                    "'first_sample'."
                )
            scheduled = [by_name[name] for name in part.scheduling]
            n_driven = len(part.inputs) - len(scheduled)
            driven = list(given[:n_driven]) if signals is None else signals
            signals = part.wired(board, [*driven, *scheduled])
        assert signals is not None
        return signals

    def inverse(self) -> Series:
        """Return the reversed series of the inverses; each part must have one."""
        return Series(tuple(part.inverse() for part in reversed(self.parts)))

    def reachable(self) -> tuple[Array, Array]:
        """Return the outputs that can be reached whatever happened before.

        Those of the first part, followed through the rest, which must be monotone.
        """
        low, high = self.parts[0].reachable()
        for part in self.parts[1:]:
            low, high = part.passes(low, high)
        return low, high

    def linear_system(self, sample_time: float | None = None) -> LinearSystem:
        """Return the parts one behind the other."""
        return reduce(LinearSystem.then, [part.linear_system(sample_time) for part in self.parts])

    def joined(self, parts: Sequence[str]) -> str:
        """Return what one gives going into the next."""
        return rf"y = {'['.join(reversed(parts))}[u{']' * len(parts)}"

    @classmethod
    def example(cls) -> Self:
        """Return a modified Prandtl-Ishlinskii model: a PI model and a saturating curve."""
        from mckibben.blocks.hysteresis.pi import PI
        from mckibben.blocks.memoryless.piecewise_linear import PiecewiseLinear

        return cls((PI.example(), PiecewiseLinear.example()))


@dataclass(frozen=True, config=STRICT)
class Parallel(Composition):
    """Blocks with the same inputs, whose outputs are added.

    Parameters
    ----------
    parts : sequence of Block
        At least one, all with the same number of outputs and the same inputs.
    """

    kind: ClassVar[str] = "parallel"

    parts: Parts

    def __post_init__(self) -> None:
        self.check_parts()
        for part in self.parts[1:]:
            if part.inputs != self.parts[0].inputs or part.outputs != self.parts[0].outputs:
                raise ModelError(
                    f"{part.kind!r} and {self.parts[0].kind!r} differ in their channels. "
                    "Remedy: put blocks in parallel that have the same inputs and outputs."
                )

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Those of every part."""
        return self.parts[0].inputs

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Those of the first part."""
        return self.parts[0].scheduling

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Those of every part."""
        return self.parts[0].outputs

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the parts' states."""
        shared = zip(self.parts, self._shared_initial(initial), strict=True)
        return np.concatenate([part.initial_state(first, own) for part, own in shared])

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that runs every part and adds the outputs."""
        own = [np.empty_like(outputs) for _ in self.parts]
        shares = zip(self.parts, self._states(state), own, strict=True)
        runs = [part.bind(sample_time, share, inputs, into) for part, share, into in shares]

        def run() -> None:
            outputs[:] = 0.0
            for step, result in zip(runs, own, strict=True):
                step()
                np.add(outputs, result, out=outputs)

        return run

    def wired(self, board: Board, given: Sequence[str]) -> list[str]:
        """Lay out the parts on the same signals, and add what they give."""
        all_given = [part.wired(board, given) for part in self.parts]
        return [board.add(terms) for terms in zip(*all_given, strict=True)]

    def linear_system(self, sample_time: float | None = None) -> LinearSystem:
        """Return the sum of the parts."""
        return reduce(LinearSystem.beside, [part.linear_system(sample_time) for part in self.parts])

    def joined(self, parts: Sequence[str]) -> str:
        """Return their sum."""
        return f"y = {' + '.join(f'{part}[u]' for part in parts)}"

    @classmethod
    def example(cls) -> Self:
        """Return the sum of a PI model and a play operator."""
        from mckibben.blocks.hysteresis.pi import PI
        from mckibben.blocks.hysteresis.play_operators import Play

        return cls((PI.example(), Play.example()))


@dataclass(frozen=True, config=STRICT)
class PerChannel(Composition):
    """One block to every channel: block k drives output k from input k.

    Parameters
    ----------
    parts : sequence of Block
        One a channel, each with one input and one output, all channel names different.
    """

    kind: ClassVar[str] = "per-channel"
    letter: ClassVar[str] = "C"

    parts: Parts

    def __post_init__(self) -> None:
        self.check_parts()
        for part in self.parts:
            if len(part.inputs) != 1 or len(part.outputs) != 1:
                raise ModelError(
                    f"{part.kind!r} has {len(part.inputs)} input(s) and {len(part.outputs)} "
                    "output(s). Remedy: give blocks with one of each."
                )
        for channels in (self.inputs, self.outputs):
            if len({channel.name for channel in channels}) < len(channels):
                raise ModelError(
                    f"channel names repeat: {', '.join(c.name for c in channels)}. "
                    "Remedy: name them pressure_1, pressure_2 and so on."
                )

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """One of every part."""
        return tuple(part.inputs[0] for part in self.parts)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """One of every part."""
        return tuple(part.outputs[0] for part in self.parts)

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the parts' states."""
        shared = zip(self.parts, first, self._shared_initial(initial), strict=True)
        return np.concatenate([part.initial_state(np.array([u]), own) for part, u, own in shared])

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that runs every part on its own channel."""
        n = inputs.shape[0]
        columns = [(np.empty((n, 1)), np.empty((n, 1))) for _ in self.parts]
        shares = zip(self.parts, self._states(state), columns, strict=True)
        runs = [part.bind(sample_time, share, *column) for part, share, column in shares]

        def run() -> None:
            for index, (step, (given, into)) in enumerate(zip(runs, columns, strict=True)):
                given[:, 0] = inputs[:, index]
                step()
                outputs[:, index] = into[:, 0]

        return run

    def wired(self, board: Board, given: Sequence[str]) -> list[str]:
        """Lay out the parts, each on its own signal."""
        pairs = zip(self.parts, given, strict=True)
        return [part.wired(board, [signal])[0] for part, signal in pairs]

    def inverse(self) -> PerChannel:
        """Return the inverses, channel by channel."""
        return PerChannel(tuple(part.inverse() for part in self.parts))

    def reachable(self) -> tuple[Array, Array]:
        """Return the outputs that every channel can reach whatever happened before."""
        ends = [part.reachable() for part in self.parts]
        return np.concatenate([low for low, _ in ends]), np.concatenate([high for _, high in ends])

    def joined(self, parts: Sequence[str]) -> str:
        """Return each on its own."""
        return r",\quad ".join(f"y_{{{k}}} = {part}[u_{{{k}}}]" for k, part in enumerate(parts, 1))

    @classmethod
    def example(cls) -> Self:
        """Return two muscles with models of their own."""
        from mckibben.blocks.hysteresis.gpi import GPI
        from mckibben.blocks.hysteresis.pi import PI

        pressures = [Channel(f"pressure_{number}", "bar") for number in (1, 2)]
        displacements = [Channel(f"displacement_{number}", "mm") for number in (1, 2)]
        first = replace(PI.example(), input=pressures[0], output=displacements[0])
        second = replace(GPI.example(), input=pressures[1], output=displacements[1])
        return cls((first, second))

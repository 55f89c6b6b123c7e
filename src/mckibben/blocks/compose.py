"""Compositions of blocks: in series, in parallel, and per channel.

Each says once, in `wired`, which part runs on which signals. From that they run, stream and start here,
have derivatives, and become C; the inverse of a series is the reversed series of the inverses.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass as plain_dataclass
from dataclasses import replace
from functools import cached_property, partial
from itertools import groupby, pairwise
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from annotated_types import MinLen
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Advance, Block, Board
from mckibben.blocks.fields import STRICT, Channel, Initial
from mckibben.blocks.ranges import first_known
from mckibben.blocks.saving import nested
from mckibben.blocks.starts import stated
from mckibben.errors import ModelError
from mckibben.registry import load
from mckibben.system.compiling import in_turn


@plain_dataclass
class Call:
    """Call of a block that is not a composition, or of a sum, on signals; and its output signals."""

    block: Block | None
    taken: list[int]
    given: list[int]
    state: Array | None = None


class Layout:
    """Calls of a composition, in order, on numbered signals; inputs first.

    Parameters
    ----------
    block : Block
        What is laid out.
    from_rest : bool
        Whether blocks are started by what those before them give at rest, as in C, where these cannot
        be run before the start.
    """

    def __init__(self, block: Block, *, from_rest: bool = False) -> None:
        self.block, self.from_rest, self.steps = block, from_rest, list[Call]()
        self.n_inputs = self.n_signals = len(block.inputs)
        self.given = block.wired(self, range(self.n_inputs))

    def _append(self, block: Block | None, taken: Sequence[int], count: int) -> list[int]:
        outputs = [*range(self.n_signals, self.n_signals + count)]
        self.steps.append(Call(block, [*taken], outputs))
        self.n_signals += count
        return outputs

    def call(self, block: Block, taken: Sequence[int]) -> list[int]:
        """Append a block, and return its output signals."""
        return self._append(block, taken, len(block.outputs))

    def add(self, terms: Sequence[int]) -> int:
        """Append a sum, unless there is only one signal, and return its output signal."""
        if len(terms) == 1:
            return terms[0]
        return self._append(None, terms, 1)[0]

    def resume(self, state: Sequence[float] | Array) -> None:
        """Set the start state of the blocks called last from their joint state."""
        rest = np.array(state, dtype=np.float64)
        for call, block in reversed(list(self.calls())):
            if rest.size:
                rest, call.state = np.split(rest, [rest.size - block.n_states])

    def calls(self) -> Iterator[tuple[Call, Block]]:
        """Yield the calls of blocks, in order."""
        return ((step, step.block) for step in self.steps if step.block is not None)

    def initial_state(
        self, first: Array, initial: Initial | None, sample_time: float | None
    ) -> Array:
        """Return the states of all blocks, each started from its first input sample."""
        signals = np.zeros(self.n_signals)
        signals[: self.n_inputs] = first
        passed_on: set[int] = set()
        for step in reversed(self.steps):
            if step.block is not None or passed_on.issuperset(step.given):
                passed_on.update(step.taken)
        states, rest = [np.empty(0)], None
        if not isinstance(initial, str | None):
            rest = stated(self.block.kind, self.block.n_states, initial).tolist()
        for step in self.steps:
            sample, block = signals[step.taken], step.block
            if block is None:
                signals[step.given] = sample.sum()
                continue
            start = initial if step.state is None or initial is not None else step.state.tolist()
            if rest is not None:
                start, rest = rest[: block.n_states], rest[block.n_states :]
            states.append(block.initial_state(sample, start, sample_time))
            if rest is None and not passed_on.isdisjoint(step.given):
                outputs, _ = block.run(sample[np.newaxis], sample_time, states[-1].tolist())
                signals[step.given] = outputs[0]
        return np.concatenate(states)

    def bind(
        self, sample_time: float | None, state: Array, inputs: Array, outputs: Array
    ) -> Advance:
        tables = {tuple(range(self.n_inputs)): inputs}
        places = [(inputs, column) for column in range(self.n_inputs)]  # of signals
        runs: list[Advance] = []

        def neighbours(numbered: tuple[int, int]) -> tuple[int, int]:
            return id(places[numbered[1]][0]), numbered[1] - numbered[0]

        def copy(signals: Sequence[int], into: Array) -> None:
            for _, group in groupby(enumerate(signals), neighbours):
                (first, signal), *copies = group
                (table, column), count = places[signal], 1 + len(copies)
                target, source = into[:, first : first + count], table[:, column : column + count]
                runs.append(partial(np.copyto, target, source))

        for step in self.steps:
            into = outputs if step.given == self.given else np.empty((len(inputs), len(step.given)))
            if step.block is None:
                terms = [places[signal] for signal in step.taken]
                runs.append(
                    partial(_add, [table[:, column] for table, column in terms], into[:, 0])
                )
            else:
                taken = tables.get(tuple(step.taken))
                if taken is None:
                    taken = np.empty((len(inputs), len(step.taken)))
                    copy(step.taken, taken)
                share, state = np.split(state, [step.block.n_states])
                runs.append(step.block.bind(sample_time, share, taken, into))
            tables[tuple(step.given)] = into
            places += [(into, column) for column in range(len(step.given))]
        if tuple(self.given) not in tables:
            copy(self.given, outputs)
        return in_turn(*runs)


def _add(terms: Sequence[Array], total: Array) -> None:
    total[:] = 0.0
    for term in terms:
        np.add(total, term, out=total)


def _parts(value: object) -> object:
    return tuple(nested(part) for part in value) if isinstance(value, tuple | list) else value


Parts = Annotated[tuple[InstanceOf[Block], ...], MinLen(1), BeforeValidator(_parts)]


def _of_any(name: str) -> Any:
    """Return a property that is true if it is true for any part."""
    return property(lambda composition: any(getattr(part, name) for part in composition.parts))


class Composition(Block):
    """Base class of compositions: states and parameters are those of the parts in order."""

    parameters: ClassVar[tuple[str, ...]] = ("parts",)
    together: ClassVar[Callable[[Iterable[float]], float]] = max  # of dead times side by side

    letter: ClassVar[str] = "P"  # of its parts in equations

    parts: tuple[Block, ...]

    @abstractmethod
    def joined(self, parts: Sequence[str]) -> str:
        """Return the LaTeX expression of the composition, from the names of the parts."""

    def equations(self) -> tuple[str, ...]:
        marks = [f"{self.letter}_{{{k + 1}}}" for k in range(len(self.parts))]
        return (self.joined(marks),)

    rate_dependent = _of_any("rate_dependent")
    of_local_rules = _of_any("of_local_rules")
    inverts = _of_any("inverts")

    @property
    def is_linear(self) -> bool:  # type: ignore[override]
        return all(part.is_linear for part in self.parts)

    @property
    def dead_time(self) -> float:  # type: ignore[override]
        return type(self).together(part.dead_time for part in self.parts)

    @property
    def sample_time(self) -> float | None:  # type: ignore[override]
        """The first fixed sample time of a part [s]; None if none has one."""
        return next((part.sample_time for part in self.parts if part.sample_time), None)

    @cached_property
    def wiring(self) -> Layout:
        """The calls of the parts, in order."""
        return Layout(self)

    def initial_state(
        self, first: Array, initial: Initial | None = None, sample_time: float | None = None
    ) -> Array:
        return self.wiring.initial_state(first, initial, sample_time)

    def bind(
        self, sample_time: float | None, state: Array, inputs: Array, outputs: Array
    ) -> Advance:
        return self.wiring.bind(sample_time, state, inputs, outputs)


@dataclass(frozen=True, config=STRICT)
class Series(Composition):
    """Series connection: the outputs of each block drive the next.

    Scheduling inputs of later parts become inputs of the series.

    Parameters
    ----------
    parts : sequence of Block
        In the order of the signal; at least one.
    """

    kind = "series"
    together = sum

    parts: Parts

    def __post_init__(self) -> None:
        for before, after in pairwise(self.parts):
            driven = after.n_driven
            if len(before.outputs) != driven:
                raise ModelError(
                    f"{before.kind!r} has {len(before.outputs)} output(s), "
                    f"{after.kind!r} after it takes {driven}",
                    parameter="parts",
                    remedy="connect blocks with matching channels",
                )

    @cached_property  # asked for at every level of a nested model
    def inputs(self) -> tuple[Channel, ...]:
        """Inputs of the first part, then scheduling inputs of later parts."""
        channels = {channel.name: channel for channel in self.parts[0].inputs}
        for part in self.parts[1:]:
            for channel in part.inputs[part.n_driven :]:
                channels.setdefault(channel.name, channel)
        return tuple(channels.values())

    @cached_property
    def scheduling(self) -> tuple[str, ...]:
        first = self.parts[0]
        driven = {c.name for c in first.inputs[: first.n_driven]}
        return tuple(c.name for c in self.inputs if c.name not in driven)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        return self.parts[-1].outputs

    @property
    def samples_ahead(self) -> int:  # type: ignore[override]
        return sum(part.samples_ahead for part in self.parts)

    def _known_of_parts(self) -> list[tuple[tuple[Channel, ...], Array]]:
        """Return those of the first part, and of what schedules others: the rest is within.

        Where the first part knows none of a channel, it is that of the next one through the curve
        between.
        """
        first, *rest = self.parts
        ranges = [(first.inputs, first.known_inputs)]
        ranges += [
            (part.inputs[part.n_driven :], part.known_inputs[part.n_driven :]) for part in rest
        ]
        for curve in first.parts if isinstance(first, PerChannel) else (first,):
            behind = first_known(
                curve.outputs, [(part.inputs, part.known_inputs) for part in rest[:1]]
            )
            bare = not (curve.path_dependent or curve.rate_dependent)
            if bare and len(curve.inputs) == len(behind) == 1 and np.isfinite(behind).all():
                with suppress(ModelError):
                    ends = curve.inverse().simulate(behind[0])
                    ranges.append((curve.inputs, np.sort(ends).reshape(1, 2)))
        return ranges

    def wired(self, board: Board, taken: Sequence[Any]) -> list[Any]:
        signal_of = dict(zip((channel.name for channel in self.inputs), taken, strict=True))
        signals = list(taken)
        for number, part in enumerate(self.parts):
            at_rest = not part.rate_dependent or part.start == "first_sample"
            if board.from_rest and number < len(self.parts) - 1 and not at_rest:
                raise ModelError(
                    f"{part.kind!r} has a saved start state and depends on the rate, so "
                    "parts after it would start from another sample than in Python",
                    parameter="initial",
                    remedy="start it from 'first_sample'",
                )
            driven = signals[: part.n_driven]
            signals = part.wired(board, [*driven, *(signal_of[name] for name in part.scheduling)])
        return signals

    def inverse(self) -> Series:
        return Series(tuple(part.inverse() for part in reversed(self.parts)))

    def reachable(self) -> tuple[Array, Array]:
        """Return the outputs that are reachable from every state.

        Those of the first part, followed through the rest, which must be monotone.
        """
        low, high = self.parts[0].reachable()
        for part in self.parts[1:]:
            low, high = part.passes(low, high)
        return low, high

    def joined(self, parts: Sequence[str]) -> str:
        return rf"y = {'['.join(reversed(parts))}[u{']' * len(parts)}"

    @classmethod
    def example(cls) -> Self:
        return cls((load("blocks", "pi").example(), load("blocks", "piecewise-linear").example()))


@dataclass(frozen=True, config=STRICT)
class Parallel(Composition):
    """Parallel connection: outputs of the same name are added.

    Parameters
    ----------
    parts : sequence of Block
        At least one. Each takes its inputs, by their names, from those of all.
    """

    kind = "parallel"

    parts: Parts

    def __post_init__(self) -> None:
        for side in ("inputs", "outputs"):
            units: dict[str, str] = {}
            for channel in (c for part in self.parts for c in getattr(part, side)):
                if units.setdefault(channel.name, channel.unit) != channel.unit:
                    raise ModelError(
                        f"parts of {self.kind!r} have it in "
                        f"{units[channel.name]!r} and {channel.unit!r}",
                        channel=channel.name,
                        remedy="put blocks in parallel whose units agree",
                    )

    @cached_property
    def inputs(self) -> tuple[Channel, ...]:
        """Driving inputs of any part, then inputs that only schedule."""
        channels = {channel.name: channel for part in self.parts for channel in part.inputs}
        return tuple(
            sorted(channels.values(), key=lambda channel: channel.name not in self._driving)
        )

    @property
    def scheduling(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.inputs if c.name not in self._driving)

    @cached_property
    def _driving(self) -> set[str]:
        return {c.name for part in self.parts for c in part.inputs if c.name not in part.scheduling}

    @cached_property
    def outputs(self) -> tuple[Channel, ...]:
        return tuple({c.name: c for part in self.parts for c in part.outputs}.values())

    def _places(self, part: Block) -> tuple[list[int], list[int]]:
        """Return the indices of a part's inputs and outputs among those of the composition."""
        names = [channel.name for channel in self.inputs]
        output_names = [channel.name for channel in self.outputs]
        input_places = [names.index(channel.name) for channel in part.inputs]
        return input_places, [output_names.index(channel.name) for channel in part.outputs]

    def wired(self, board: Board, taken: Sequence[Any]) -> list[Any]:
        terms: list[list[Any]] = [[] for _ in self.outputs]
        for part in self.parts:
            input_places, places = self._places(part)
            signals = part.wired(board, [taken[index] for index in input_places])
            for index, signal in zip(places, signals, strict=True):
                terms[index].append(signal)
        return [board.add(input_places) for input_places in terms]

    def joined(self, parts: Sequence[str]) -> str:
        return f"y = {' + '.join(f'{part}[u]' for part in parts)}"

    @classmethod
    def example(cls) -> Self:
        return cls((load("blocks", "pi").example(), load("blocks", "play").example()))


@dataclass(frozen=True, config=STRICT)
class PerChannel(Composition):
    """One block per channel: block k drives output k from input k.

    Parameters
    ----------
    parts : sequence of Block
        One a channel, each with one input and one output, all channel names different.
    """

    kind = "per-channel"
    letter = "C"

    parts: Parts

    def __post_init__(self) -> None:
        for part in self.parts:
            if len(part.inputs) != 1 or len(part.outputs) != 1:
                raise ModelError(
                    f"{part.kind!r} has {len(part.inputs)} input(s) and "
                    f"{len(part.outputs)} output(s)",
                    remedy="give blocks with one of each",
                )
        self.check_channels()

    @property
    def inputs(self) -> tuple[Channel, ...]:
        return tuple(part.inputs[0] for part in self.parts)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        return tuple(part.outputs[0] for part in self.parts)

    def wired(self, board: Board, taken: Sequence[Any]) -> list[Any]:
        pairs = zip(self.parts, taken, strict=True)
        return [part.wired(board, [signal])[0] for part, signal in pairs]

    def inverse(self) -> PerChannel:
        return PerChannel(tuple(part.inverse() for part in self.parts))

    def reachable(self) -> tuple[Array, Array]:
        ends = [part.reachable() for part in self.parts]
        return np.concatenate([low for low, _ in ends]), np.concatenate([high for _, high in ends])

    def joined(self, parts: Sequence[str]) -> str:
        return r",\quad ".join(f"y_{{{k}}} = {part}[u_{{{k}}}]" for k, part in enumerate(parts, 1))

    @classmethod
    def example(cls) -> Self:
        pressures = [Channel(f"pressure_{number}", "bar") for number in (1, 2)]
        displacements = [Channel(f"displacement_{number}", "mm") for number in (1, 2)]
        first = replace(load("blocks", "pi").example(), input=pressures[0], output=displacements[0])
        second = replace(
            load("blocks", "gpi").example(), input=pressures[1], output=displacements[1]
        )
        return cls((first, second))

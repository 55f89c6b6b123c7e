"""Compositions flattened: which part runs when, on which signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Parallel, PerChannel, Series
from mckibben.blocks.feedforward_feedback import FeedforwardFeedback
from mckibben.errors import ModelError
from mckibben.export.c.parts import Part, part_of, starts_at_rest


@dataclass(frozen=True)
class Call:
    """One part run on signals: C expressions in, places of the signal table out."""

    part: Part
    inputs: tuple[str, ...]
    first_output: int
    first_state: int


@dataclass(frozen=True)
class Sum:
    """Signals added into one."""

    terms: tuple[str, ...]
    output: int


@dataclass
class Wiring:
    """What a model does in a step, in order.

    Parameters
    ----------
    block : Block
        The model.
    sample_time : float or None
        Time between steps [s].
    """

    block: Block
    sample_time: float | None
    steps: list[Call | Sum] = field(default_factory=list)
    n_signals: int = 0
    n_numbers: int = 0

    def __post_init__(self) -> None:
        given = [f"in[{index}]" for index in range(len(self.block.inputs))]
        self.outputs = self._run(self.block, given)

    @property
    def calls(self) -> list[Call]:
        """The parts, in order."""
        return [step for step in self.steps if isinstance(step, Call)]

    def _run(self, block: Block, given: Sequence[str]) -> list[str]:
        """Append what a block does to signals, and return the signals that it gives."""
        if isinstance(block, Series):
            return self._series(block, given)
        if isinstance(block, Parallel):
            all_given = [self._run(part, given) for part in block.parts]
            return [self._sum(terms) for terms in zip(*all_given, strict=True)]
        if isinstance(block, PerChannel):
            pairs = zip(block.parts, given, strict=True)
            return [self._run(part, [signal])[0] for part, signal in pairs]
        if isinstance(block, FeedforwardFeedback):
            n = len(block.feedback.driven)
            bases = self._run(block.compensator, [*given[:n], *given[2 * n :]])
            return self._run(block.feedback, [*given[: 2 * n], *bases])
        call = Call(part_of(block, self.sample_time), tuple(given), self.n_signals, self.n_numbers)
        self.steps.append(call)
        self.n_numbers += block.n_states + block.n_scratch
        return self._new_signals(len(block.outputs))

    def _series(self, block: Series, given: Sequence[str]) -> list[str]:
        by_name = dict(zip((channel.name for channel in block.inputs), given, strict=True))
        signals: list[str] | None = None
        for number, part in enumerate(block.parts):
            if number < len(block.parts) - 1 and not starts_at_rest(part):
                raise ModelError(
                    f"{part.kind!r} starts from a memory of its own and depends on the rate, so parts "
                    "behind it would start from another sample than in Python. Remedy: start it from "
                    "'first_sample'."
                )
            scheduled = [by_name[name] for name in part.scheduling]
            n_driven = len(part.inputs) - len(scheduled)
            driven = list(given[:n_driven]) if signals is None else signals
            signals = self._run(part, [*driven, *scheduled])
        assert signals is not None
        return signals

    def _sum(self, terms: tuple[str, ...]) -> str:
        if len(terms) == 1:
            return terms[0]
        self.steps.append(Sum(terms, self.n_signals))
        return self._new_signals(1)[0]

    def _new_signals(self, count: int) -> list[str]:
        first = self.n_signals
        self.n_signals += count
        return [f"signals[{first + index}]" for index in range(count)]

"""A compensator with feedback on top, as one block: what runs on the robot."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Board, Run
from mckibben.blocks.compose import Composition
from mckibben.blocks.feedback.pid import PIDFeedback
from mckibben.blocks.fields import STRICT, Channel, Initial
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError


@dataclass(frozen=True, config=STRICT)
class FeedforwardFeedback(Composition):
    """Outputs of a compensator, corrected by what is measured.

    Inputs are the references, what is measured, and what schedules the compensator.

    Parameters
    ----------
    compensator : Block
        From references, and what schedules it, to pressures.
    feedback : PIDFeedback
        Whose references are the compensator's, and whose bases are what the compensator gives.
    """

    kind: ClassVar[str] = "feedforward-feedback"
    parameters: ClassVar[tuple[str, ...]] = ("compensator", "feedback")

    compensator: Annotated[InstanceOf[Block], BeforeValidator(nested)]
    feedback: Annotated[InstanceOf[PIDFeedback], BeforeValidator(nested)]

    def __post_init__(self) -> None:
        self.check_parts()
        n = len(self.compensator.outputs)
        n_driven = len(self.compensator.inputs) - len(self.compensator.scheduling)
        if (len(self.feedback.driven), len(self.feedback.scheduled)) != (n_driven, n + n_driven):
            raise ModelError(
                f"feedback of {len(self.feedback.driven)} references with "
                f"{len(self.feedback.scheduled)} measurements and bases does not fit a compensator of "
                f"{n_driven} references and {n} outputs. Remedy: give one measurement to a reference "
                "and one base to an output."
            )
        names = [channel.name for channel in self.inputs]
        if len(set(names)) < len(names):
            raise ModelError(
                f"inputs of {self.kind!r} are {names}. Remedy: give each a name of its own."
            )

    @classmethod
    def of(cls, compensator: Block, feedback: PIDFeedback) -> Self:
        """Return a compensator with feedback, which may have stood by itself, on top."""
        return cls(compensator, feedback.behind(compensator))

    @property
    def parts(self) -> tuple[Block, ...]:  # type: ignore[override]
        """Compensator, then feedback."""
        return (self.compensator, self.feedback)

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Always: feedback integrates."""
        return True

    @property
    def path_dependent(self) -> bool:  # type: ignore[override]
        """As the compensator."""
        return self.compensator.path_dependent

    @property
    def undone(self) -> Block | None:
        """What the compensator undoes."""
        return self.compensator.undone

    @property
    def samples_ahead(self) -> int:  # type: ignore[override]
        """As many as the compensator wants."""
        return self.compensator.samples_ahead

    @property
    def measured(self) -> tuple[Channel, ...]:
        """What is measured."""
        return self.feedback.scheduled[: len(self.feedback.driven)]

    @cached_property
    def inputs(self) -> tuple[Channel, ...]:
        """References, measurements, and what else the compensator takes, which may learn from these."""
        n = len(self.feedback.driven)
        others = (c for c in self.compensator.inputs[n:] if c not in self.measured)
        return (*self.compensator.inputs[:n], *self.measured, *others)

    @cached_property
    def _taken(self) -> list[int]:
        """Which inputs the compensator takes."""
        return [self.inputs.index(channel) for channel in self.compensator.inputs]

    @cached_property
    def scheduling(self) -> tuple[str, ...]:
        """All inputs but the references."""
        return tuple(channel.name for channel in self.inputs[len(self.feedback.driven) :])

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """The compensator's."""
        return self.compensator.outputs

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        own, feedback = self._shared_initial(initial)
        n = len(self.feedback.driven)
        both = np.concatenate([first[: 2 * n], np.zeros(n)])
        return np.concatenate(
            [
                self.compensator.initial_state(np.asarray(first)[self._taken], own),
                self.feedback.initial_state(both, feedback),
            ]
        )

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        n, length = len(self.feedback.driven), inputs.shape[0]
        ahead, asked = self._states(state)
        wanted = np.empty((length, len(self.compensator.inputs)))
        base = np.empty((length, len(self.outputs)))
        given = np.empty((length, len(self.feedback.inputs)))
        compensate = self.compensator.bind(sample_time, ahead, wanted, base)
        correct = self.feedback.bind(sample_time, asked, given, outputs)

        def run() -> None:
            wanted[:] = inputs[:, self._taken]
            compensate()
            given[:, : 2 * n] = inputs[:, : 2 * n]
            given[:, 2 * n :] = base
            correct()

        return run

    def wired(self, board: Board, given: Sequence[str]) -> list[str]:
        n = len(self.feedback.driven)
        bases = self.compensator.wired(board, [given[place] for place in self._taken])
        return self.feedback.wired(board, [*given[: 2 * n], *bases])

    def joined(self, parts: Sequence[str]) -> str:
        """Return the sum of what both give, the feedback from the compensator's references."""
        return f"p = {parts[0]}[r] + {parts[1]}[r, y]"

    @classmethod
    def example(cls) -> Self:
        from mckibben.blocks.coupled.balance import Balance

        return cls(Balance.example(), PIDFeedback.example())

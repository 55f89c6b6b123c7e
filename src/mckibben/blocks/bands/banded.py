"""A model with its band: what is simulated, streamed and saved where it matters how sure a model is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.bands.band import Band
from mckibben.blocks.base import Block, Board, Run, explicit_state
from mckibben.blocks.fields import STRICT, Channel, Initial
from mckibben.blocks.notation import Notation
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError
from mckibben.recording import Recording
from mckibben.registry import load
from mckibben.system.compiling import in_turn


@dataclass(frozen=True, config=STRICT)
class Banded(Block):
    """A model whose every output comes with a lower and an upper end.

    Parameters
    ----------
    forward : Block
        The model.
    band : Band
        Of its inputs and outputs; `mckibben.calibrate` finds it.

    Examples
    --------
    >>> import mckibben
    >>> banded = mckibben.Banded.example().at(0.8)
    >>> [channel.name for channel in banded.outputs]
    ['displacement', 'displacement_lower', 'displacement_upper']
    """

    kind: ClassVar[str] = "banded"
    parameters: ClassVar[tuple[str, ...]] = ("forward", "band")
    notation: ClassVar[Notation] = Notation(r"y = P[u],\quad (y^{-},\, y^{+}) = \text{band}[u, y]")

    forward: Annotated[InstanceOf[Block], BeforeValidator(nested)]
    band: Annotated[InstanceOf[Band], BeforeValidator(nested)]

    def __post_init__(self) -> None:
        if self.band.inputs != (*self.forward.inputs, *self.forward.outputs):
            raise ModelError(
                f"the band is of other channels than {self.forward.title!r}. Remedy: calibrate it again."
            )

    def at(self, level: float) -> Self:
        """Return the model with its band at another level.

        Raises
        ------
        ModelError
            On a level outside 0 to 1, or one that calibration had too few runs for.
        """
        return replace(self, band=replace(self.band, level=float(level)))

    @property
    def title(self) -> str:
        """That of the model, and that it has a band."""
        return f"{self.forward.title}-banded"

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether the model or the band is."""
        return self.forward.rate_dependent or self.band.rate_dependent

    @property
    def path_dependent(self) -> bool:  # type: ignore[override]
        """Whether the model is."""
        return self.forward.path_dependent

    @property
    def of_local_rules(self) -> bool:  # type: ignore[override]
        """Whether the model is."""
        return self.forward.of_local_rules

    @property
    def sample_time(self) -> float | None:  # type: ignore[override]
        """The model's."""
        return self.forward.sample_time

    @property
    def dead_time(self) -> float:  # type: ignore[override]
        """The model's."""
        return self.forward.dead_time

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """The model's."""
        return self.forward.inputs

    @property
    def scheduling(self) -> tuple[str, ...]:
        """The model's."""
        return self.forward.scheduling

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Each of the model's, then its lower and its upper end."""
        return self.band.outputs

    @property
    def n_states(self) -> int:
        """The model's, then the band's."""
        return self.forward.n_states + self.band.n_states

    @property
    def n_scratch(self) -> int:
        """The model's and the band's."""
        return self.forward.n_scratch + self.band.n_scratch

    @property
    def start(self) -> Initial:
        """The model's."""
        return self.forward.start

    def start_on(self, recording: Recording, initial: Initial | None = None) -> Initial | None:
        """Return the model's start; the band's motion begins at rest."""
        return self.forward.start_on(recording, initial)

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the model's state, then that of a motion that begins at rest.

        An explicit state may be this block's own, or the model's.
        """
        n = self.forward.n_states
        if initial is None or isinstance(initial, str) or len(initial) == n != self.n_states:
            return np.append(
                self.forward.initial_state(first, initial), self.band.initial_state(first)
            )
        state = explicit_state(self, initial)
        self.forward.initial_state(first, state[:n].tolist())  # which knows what states can be
        return state

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that runs the model, and the band behind it."""
        n, n_given = self.forward.n_states, len(self.forward.outputs)
        modelled = np.empty((len(inputs), n_given))
        both = np.empty((len(inputs), inputs.shape[1] + n_given))

        def gather() -> None:
            both[:, : inputs.shape[1]] = inputs
            both[:, inputs.shape[1] :] = modelled

        return in_turn(
            self.forward.bind(sample_time, state[:n], inputs, modelled),
            gather,
            self.band.bind(sample_time, state[n:], both, outputs),
        )

    def check_time(self, sample_time: float | None) -> None:
        """Pass on what the model has to say."""
        self.forward.check_time(sample_time)

    def report(self, state: Array) -> None:
        """Pass on what the model has to say."""
        self.forward.report(state[: self.forward.n_states])

    def wired(self, board: Board, given: Sequence[str]) -> list[str]:
        """Lay out the model, and the band on what it is given and gives."""
        return board.call(self.band, [*given, *self.forward.wired(board, given)])

    def inverse(self) -> Block:
        """Refuse: a band is of outputs, and an inverse gives inputs."""
        raise ModelError(
            "a model with a band has no inverse. Remedy: invert the model that was calibrated, or "
            "banded.forward."
        )

    @classmethod
    def example(cls) -> Self:
        """Return a Prandtl-Ishlinskii model with a band."""
        return cls(load("blocks", "pi").example(), Band.example())


def inside(model: Block) -> Block:
    """Return the model of one with a band; any other as it is."""
    return model.forward if isinstance(model, Banded) else model

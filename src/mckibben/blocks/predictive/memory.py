"""The memory that a model and its inverse share: each way from one's state to the other's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Composition, PerChannel, Series
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.kernels import kernel
from mckibben.errors import ModelError

Ways = Callable[[Array], Array]


def memory_of(compensator: Block) -> Ways:
    """Return what makes the model's state of a compensator's.

    Raises
    ------
    ModelError
        If the compensator is no exact inverse, or its state does not tell the model's.
    """
    match compensator:
        case Inverse() if compensator.n_states >= compensator.forward.n_states:
            n = compensator.forward.n_states
            return lambda state: state[:n].copy()
        case Balance():
            return np.copy
        case Series() | PerChannel():
            parts = _parts(compensator)
            ways = [memory_of(part) for part in parts]
            sizes = np.cumsum([part.n_states for part in parts])[:-1]
            turn = -1 if isinstance(compensator, Series) else 1

            def joined(state: Array) -> Array:
                own = [way(share) for way, share in zip(ways, np.split(state, sizes), strict=True)]
                return np.concatenate(own[::turn])

            return joined
    if compensator.n_states == 0:
        return np.copy
    raise ModelError(
        f"{compensator.title!r} is no exact inverse whose memory could be foreseen. Remedy: invert a "
        "model such as pi, gpi, mpi or balance (mckibben invert), and give that."
    )


def undoing(compensator: Block) -> Ways:
    """Return what makes a compensator's state of its model's."""
    match compensator:
        case Inverse():
            return compensator.forward.inverse_state
        case Series() | PerChannel():
            parts = _parts(compensator)
            ways = [undoing(part) for part in parts]
            turn = -1 if isinstance(compensator, Series) else 1
            model_sizes = [part.inverse().n_states for part in parts][::turn]
            ends = np.cumsum(model_sizes)[:-1]

            def joined(state: Array) -> Array:
                shares = np.split(state, ends)[::turn]
                return np.concatenate([way(share) for way, share in zip(ways, shares, strict=True)])

            return joined
    return np.copy


def _parts(compensator: Composition) -> tuple[Block, ...]:
    return compensator.parts


Resume = Callable[[Array, Array, Array], None]


@kernel
def pi_resume(coefficients: Array, memory: Array, state: Array) -> None:
    """Fill the state of a PI model's inverse from that of the model, which has these coefficients."""
    n, y = memory.size, 0.0
    for i in range(n):
        state[i] = memory[i]
        y += coefficients[1 + n + i] * memory[i]
    state[n] = coefficients[0] + y
    state[n + 1] = 0.0


@kernel
def gpi_resume(coefficients: Array, memory: Array, state: Array) -> None:
    """Fill the state of a GPI model's inverse from that of the model, which has these coefficients."""
    n, y = memory.size - 1, 0.0
    for i in range(n):
        state[i] = memory[i]
        y += coefficients[4 + n + i] * memory[i]
    state[n], state[n + 1], state[n + 2] = memory[n], y, 0.0


@kernel
def same_resume(coefficients: Array, memory: Array, state: Array) -> None:
    """Fill a state that is that of the model."""
    state[:] = memory


def resume_of(compensator: Block) -> Resume | None:
    """Return the kernel that fills a compensator's state from its model's; None where there is none."""
    match compensator:
        case Inverse(forward=PI()):
            return pi_resume
        case Inverse(forward=GPI()):
            return gpi_resume
        case Balance():
            return same_resume
    return None

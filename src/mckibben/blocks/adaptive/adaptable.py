"""What a block declares so that its inverse can learn while it runs.

A family says which of its numbers are learnt, how far they may be off, and how the inverse runs while
they move: a kernel that for every sample calls `learning.learn` with
the slopes of what was measured, projects what was learnt onto the conditions of invertibility, takes
it over, and undoes the reference with it, so that forward and inverse match at every step.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.adaptive.learning import SENSES
from mckibben.blocks.base import Block, Kernel, Start
from mckibben.blocks.inverse import Invertible


@dataclass(frozen=True)
class Group:
    """Parameters that drift together, as people speak of them.

    Parameters
    ----------
    name : str
        As in "friction".
    more, less : str
        What it is called to have more or less of it, as in "higher" and "lower".
    """

    name: str
    more: str = "higher"
    less: str = "lower"


class Adaptable(Invertible):
    """An invertible block whose linear parameters can be learnt while its inverse runs.

    The state of the adaptive inverse is [inverse's own, `n_more_states`, theta, used, root, senses]: the
    parameters as far as they are learnt, those that the inverse runs with now, the covariance as U D U',
    and what is remembered of every sensor, see `mckibben.blocks.adaptive.learning`.
    """

    adaptive_kernel: ClassVar[Kernel]
    """Runs the inverse and learns. Inputs are the inverse's, then the outputs that answer those of the
    step before, NaN where absent; it computes in scratch."""

    adaptive_start_kernel: ClassVar[Start]
    """Fills the state of the adaptive inverse."""

    groups: ClassVar[tuple[Group, ...]]
    """What drift is told of."""

    learns_inverted: ClassVar[bool] = True
    """Whether it learns while it is undone; else while it runs, as a block that is a compensator."""

    @property
    @abstractmethod
    def taught(self) -> Array:
        """Parameters to be learnt, as fitted, shape (p,), in their units."""

    @property
    @abstractmethod
    def scales(self) -> Array:
        """Size of a change of every parameter that counts as a whole, shape (p,), positive."""

    @property
    @abstractmethod
    def spread(self) -> Array:
        """Covariance of changes to be expected, in squares of the scales, shape (p, p), definite."""

    @abstractmethod
    def retaught(self, theta: Array) -> Block:
        """Return the forward block with other parameters, shape (p,)."""

    def added(self, theta: Array) -> float:
        """Return what is added to its output, where it has no parameter of its own for that."""
        del theta
        return 0.0

    @abstractmethod
    def group_changes(self, theta: Array) -> Array:
        """Return the relative change of every group from the fitted one, shape (n_groups,)."""

    @property
    def known_span(self) -> float:
        """Largest range of an output where it was fitted; 0 if unknown."""
        return 0.0

    @property
    def whole_changes(self) -> Array:
        """How far an output moves where a group changes by the whole of it, shape (n_groups,).

        In the output's unit, infinite if unknown; by default the range where it was fitted.
        """
        return np.full(len(self.groups), self.known_span or np.inf)

    @property
    def n_more_states(self) -> int:
        """Numbers of the last sample that learning wants, behind those of the inverse."""
        return 1

    @property
    def n_learning_scratch(self) -> int:
        """Numbers to compute in, beside three a parameter and those of the inverse."""
        return 0

    def adaptive_numbers(self, sample_time: float | None) -> Array:
        """Return the family's numbers behind those of the learner; the inverse's by default."""
        return self.inverse_numbers(self.coefficients(sample_time))

    @property
    def n_learning_states(self) -> int:
        """Theta, used, root, senses."""
        p = self.taught.size
        return 2 * p + (p * (p + 1)) // 2 + SENSES * len(self.outputs)

    @classmethod
    @abstractmethod
    def example(cls) -> Self: ...


def relative_spread(common: float, friction: float, own: float, offset: float, n: int) -> Array:
    """Return the covariance of changes of n weights of play operators and of an offset.

    All weights change in common, those of operators with a threshold by friction too, every weight by
    itself, and the offset: standard deviations in scales.
    """
    sliding = np.array([0.0, *np.ones(n - 1), 0.0])
    weights = np.array([*np.ones(n), 0.0])
    covariance = common**2 * np.outer(weights, weights) + friction**2 * np.outer(sliding, sliding)
    return np.asarray(
        covariance + np.diag([*np.full(n, own**2), offset**2]),
    )

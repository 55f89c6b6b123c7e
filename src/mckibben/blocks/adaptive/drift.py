"""How far a learner has gone from the fit: by groups of parameters, in standard errors, in a sentence.

A standard error is that of the learner's covariance, and what a fit itself is wrong by: a little of
every group, and whatever moves the output no further than its usual error. What the form of a model
leaves goes with the motion and is never averaged out: other motion makes it look like other parameters.
An alarm is given where a change is too many standard errors for chance, at a told rate of false ones,
when one look is independent of the next after the time to learn in.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.adaptive.adaptable import Group

FALSE_ALARMS = 1e-3
"""An hour, where nothing drifts."""
FIT_ERROR = 0.01
"""Standard error of a fit itself, of every group."""


@dataclass(frozen=True)
class Drift:
    """What has changed since the fit.

    Parameters
    ----------
    groups : tuple of Group
        What changes are told of.
    changes, errors : tuple of float
        Relative change of every group, and its standard error.
    limit : float
        Standard errors at which an alarm is given.
    measured : bool
        Whether anything was, by now.
    """

    groups: tuple[Group, ...]
    changes: tuple[float, ...]
    errors: tuple[float, ...]
    limit: float
    measured: bool = True

    @property
    def by_errors(self) -> tuple[float, ...]:
        """Changes in standard errors."""
        return tuple(c / e for c, e in zip(self.changes, self.errors, strict=True))

    @property
    def alarms(self) -> tuple[bool, ...]:
        """Whether a group has changed by more than chance."""
        return tuple(abs(size) > self.limit for size in self.by_errors)

    @property
    def alarm(self) -> bool:
        """Whether any has."""
        return any(self.alarms)

    def __str__(self) -> str:
        if not self.measured:
            return "nothing measured yet"
        told = [
            f"{group.name} {abs(change):.0%} {group.more if change > 0 else group.less}".replace(
                "%", " %"
            )
            for group, change, alarm in zip(self.groups, self.changes, self.alarms, strict=True)
            if alarm
        ]
        same = [g.name for g, alarm in zip(self.groups, self.alarms, strict=True) if not alarm]
        if not told:
            return f"{' and '.join(same)} unchanged since the day of the fit"
        since = " than on the day of the fit"
        return "; ".join(
            [", ".join(told) + since, *([f"{', '.join(same)} unchanged"] if same else [])]
        )


def alarm_limit(time: float, n_groups: int, rate: float = FALSE_ALARMS) -> float:
    """Return the standard errors at which alarms are false at a rate [1/h]; ``time`` in s."""
    looks = n_groups * 3600.0 / time
    return -NormalDist().inv_cdf(min(rate / looks, 0.5) / 2.0)


def scatter(covariance: Array, slopes: Array, left: Array) -> Array:
    """Return the standard error of every group, shape (n_groups,).

    Parameters
    ----------
    covariance : array, shape (p, p)
        Of the parameters, in squares of their scales.
    slopes : array, shape (n_groups, p)
        Of the groups' changes over the parameters in their scales.
    left : array, shape (n_groups,)
        Usual error, by how far the output moves with the whole of a group.
    """
    learnt = np.einsum("gi,ij,gj->g", slopes, covariance, slopes)
    return np.asarray(np.sqrt(learnt + FIT_ERROR**2 + left**2))

"""The four characteristic points of a muscle's static pressure, and their regression on the force.

Source: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and
Particle Swarm Optimization", Sections 4.2 and 4.3. First enrichment: global minimum and maximum, the
outermost turning points of the loops at a force, where the rate is nought and the pressure static;
they are regressed on the force. Second enrichment: inflection and tangent are moved to the
boundaries of low and of high pressure, which are the same at every force and outside the extremes,
so that e_3 < e_1 < e_2 < e_4 as in Table 1.

The paper does not say how the boundaries and their contractions were chosen. Here the boundaries are
at its own shares of the range of pressure, and the cubic at a force, held to its extremes, reaches
them where it is nearest to all runs there, by least squares.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.estimators.core.data import Run

FORCE_STEP = 5.0
"""Runs whose mean forces differ by less belong to one force [N]."""

LOW, HIGH = 0.07, 0.975
"""Boundaries of low and high pressure as shares of the range: Table 1 has y_3 at .028 and y_4 at
.391 MPa, of 0 to .4 MPa."""

MARGIN, FARTHEST = 0.05, 3.0
"""Least and greatest distance of a boundary from the extreme beside it: in contraction, relative to
the distance of the extremes (by Table 1, 0.2 to 1.4). The least holds for the pressures, too, relative
to their range."""


def by_force(runs: Sequence[Run]) -> dict[float, list[int]]:
    """Return which runs have one mean force [N], weakest first."""
    means = [float(run.scheduled.mean()) for run in runs]
    groups: dict[float, list[int]] = {}
    for i in np.argsort(means, kind="stable"):
        near = next((force for force in groups if abs(force - means[i]) < FORCE_STEP), means[i])
        groups.setdefault(near, []).append(int(i))
    return groups


def characteristic_points(runs: Sequence[Run], moving: Sequence[bool]) -> tuple[Array, Array]:
    """Return e_1 to e_4 and y_1 to y_4 as cubics of the force.

    Parameters
    ----------
    runs : sequence of Run
        All runs, contraction to pressure, which changes, the force being scheduled.
    moving : sequence of bool
        Which of them are loops, whose turning points are the extremes; the others are slow cycles,
        and count for the boundaries only. Where no run at a force is a loop, all there are taken.

    Returns
    -------
    array, shape (4, 4), array, shape (4, 4)
        Contractions, then pressures in the output's unit: a row a point, highest power first.

    Raises
    ------
    DataError
        Where the contraction does not move at some force.
    """
    groups = by_force(runs)
    forces = np.array(list(groups))
    pressures = np.concatenate([run.y[run.counts] for run in runs])
    lowest, span = float(pressures.min()), float(np.ptp(pressures))
    extremes = np.array(
        [
            outermost([runs[i] for i in ([i for i in own if moving[i]] or own)])
            for own in groups.values()
        ]
    )
    still = extremes[:, 1, 0] <= extremes[:, 0, 0]
    if still.any():
        raise DataError(
            f"the contraction does not move under {forces[still][0]:g} N",
            remedy="leave that run out",
        )
    # First enrichment.
    ends = np.array([[regress(forces, extremes[:, j, c]) for c in (0, 1)] for j in (0, 1)])
    fitted = np.array([[np.polyval(cubic, forces) for cubic in end] for end in ends])
    # Second enrichment.
    low = min(lowest + LOW * span, float(fitted[0, 1].min()) - MARGIN * span)
    high = max(lowest + HIGH * span, float(fitted[1, 1].max()) + MARGIN * span)
    bounds = np.array(
        [
            boundaries([runs[i] for i in own], fitted[:, :, k], (low, high))
            for k, own in enumerate(groups.values())
        ]
    )
    contractions = [*ends[:, 0], *(regress(forces, bound) for bound in bounds.T)]
    constants = [[0.0, 0.0, 0.0, level] for level in (low, high)]
    return np.array(contractions), np.array([*ends[:, 1], *constants])


def outermost(runs: Sequence[Run]) -> Array:
    """Return contraction and pressure, (2, 2), where the runs turn at the least and the most."""
    turns = np.concatenate([_turns(run) for run in runs])
    return turns[[turns[:, 0].argmin(), turns[:, 0].argmax()]]


def _turns(run: Run) -> Array:
    """Return contraction and pressure where a run turns, or of all of it where it hardly does."""
    from mckibben.signals import reversals

    # Where a run begins and ends, it does not turn.
    places = [place for place in reversals(run.u)[1:-1] if run.counts[place]]
    if len(places) < 2:
        places = list(np.flatnonzero(run.counts))
    return np.column_stack([run.u[places], run.y[places]])


def boundaries(runs: Sequence[Run], extremes: Array, levels: tuple[float, float]) -> Array:
    """Return the contractions e_3 and e_4 of a cubic that goes through the extremes at one force.

    The errors of a run are relative to its own range of pressure, so that loops and slow cycles count
    alike.
    """
    from scipy.optimize import least_squares

    (e_1, y_1), (e_2, y_2) = extremes
    e, p, weight = (np.concatenate(parts) for parts in zip(*map(_weighted, runs), strict=True))
    powers = np.vander((e - e_1) / (e_2 - e_1), 4)
    pressures = np.array([y_1, y_2, *levels])

    def errors(away: Array) -> Array:
        through = np.vander([0.0, 1.0, -away[0], 1.0 + away[1]], 4)
        found: Array = (powers @ np.linalg.solve(through, pressures) - p) * weight
        return found

    rise = max(y_2 - y_1, 1e-9)
    straight = np.array([y_1 - levels[0], levels[1] - y_2]) / rise
    start = np.clip(straight, 2 * MARGIN, 0.5 * FARTHEST)
    away = least_squares(errors, start, bounds=(MARGIN, FARTHEST)).x
    return e_1 + (e_2 - e_1) * np.array([-away[0], 1.0 + away[1]])


def _weighted(run: Run) -> tuple[Array, Array, Array]:
    """Return contraction and pressure where they count, and the weight of each sample."""
    e, p = run.u[run.counts], run.y[run.counts]
    scale = max(float(np.ptp(p)), 1e-9) * np.sqrt(max(p.size, 1))
    return e, p, np.full(p.size, 1.0 / scale)


def regress(forces: Array, values: Array) -> Array:
    """Return a cubic of the force through values, of lower order where there are few forces."""
    order = min(3, forces.size - 1)
    scale = max(float(np.abs(forces).max()), 1.0)
    found = np.polyfit(forces / scale, values, order) / scale ** np.arange(order, -1, -1)
    return np.concatenate([np.zeros(3 - order), found])

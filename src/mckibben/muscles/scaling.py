"""A muscle's force balance at another size, by geometry alone.

Lengths go with the stroke, forces per bar with the area at rest, pressures with the highest. What is
elastic, rubs or relaxes is bladder and braid under that pressure, so that forces go with its pull, and
times stay. The area's loss with contraction goes over from braid to braid only where the angles are
about the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.fields import rows, vector
from mckibben.muscles.sheet import Sheet


def scaled(balance: Balance, of: Sheet, to: Sheet) -> Balance:
    """Return the force balance of a muscle scaled to another size.

    Parameters
    ----------
    balance : Balance
        Of one muscle.
    of, to : Sheet
        Its data sheet, and that of the other size.
    """
    length = to.stroke / of.stroke
    pressure = to.max_pressure_bar / of.max_pressure_bar
    area = to.area / of.area if balance.n_loads else 1.0  # else in units of the area at rest
    force = area * pressure
    per_length = force / length

    def times(table: object, by: float | Array) -> tuple[tuple[float, ...], ...]:
        made: tuple[tuple[float, ...], ...] = rows(by * np.array(table))
        return made

    springs = np.array(balance.springs)
    springs[:, 0] *= force
    springs[:, 1:] *= per_length
    span = balance.pressure_range
    return replace(
        balance,
        springs=rows(springs),
        elasticity=times(balance.elasticity, force),
        areas=times(balance.areas, area),
        friction=times(balance.friction, per_length),
        relaxation=times(balance.relaxation, per_length),
        damping=vector(per_length * np.array(balance.damping)),
        lines=vector(per_length * np.array(balance.lines)),
        walls=vector(length / pressure * np.array(balance.walls)),
        limits=vector(length / pressure * np.array(balance.limits)),
        friction_offset=balance.friction_offset * pressure,
        friction_slopes=vector(pressure * np.array(balance.friction_slopes)),
        obstacles=times(balance.obstacles, np.tile((1.0, length, per_length), balance.n_obstacles)),
        preload=balance.preload * pressure,
        drive=times(balance.drive, pressure),
        hull=times(balance.hull, length),
        scale=balance.scale * length,
        bladders=vector(per_length * np.array(balance.bladders)),
        pushes=vector(force * np.array(balance.pushes)),
        mass=vector(per_length * np.array(balance.mass)),
        pressure_range=None if span is None else (span[0] * pressure, span[1] * pressure),
        known=(),
    )

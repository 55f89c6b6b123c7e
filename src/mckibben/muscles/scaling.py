"""A muscle's force balance at another size, by geometry alone.

Lengths go with the stroke, forces per bar with the area at rest, pressures with the highest. What is
elastic, rubs or relaxes is bladder and braid under that pressure, so that forces go with its pull, and
times stay. The area's loss with contraction goes over from braid to braid only where the angles are
about the same.
"""

from __future__ import annotations

from dataclasses import replace

from mckibben.blocks.coupled.balance import Balance, resized
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
    return replace(resized(balance, area=area, length=length, pressure=pressure), known=())

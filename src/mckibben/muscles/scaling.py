"""A muscle's force balance at another size, by geometry alone.

Lengths go with the stroke, forces per bar with the area at rest, pressures with the highest. What is
elastic, rubs or relaxes is bladder and braid under that pressure, so that forces go with its pull, and
times stay. The area's loss with contraction goes over from braid to braid only where the angles are
about the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_terms import TABLE
from mckibben.blocks.fields import rows
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


def resized(
    balance: Balance, *, area: float = 1.0, length: float = 1.0, pressure: float = 1.0
) -> Balance:
    """Return a balance with areas, lengths and pressures times these, and forces in proportion.

    Loads pull as they did.
    """
    force = area * pressure
    sizes = {"": 1.0, "N": force, "N/bar": area, "bar": pressure, "mm": length}
    sizes |= {"mm/bar": length / pressure}
    names = (name for name in Balance.parameters if name != "loads")
    units = {name: TABLE[name].units(balance.sizes) for name in names}
    units |= dict.fromkeys(("limits", "hull", "scale"), ("mm",))
    units |= dict.fromkeys(("highest_pressure", "preload", "drive"), ("bar",))
    changed: dict[str, Any] = {}
    for name, of_numbers in units.items():
        value = np.array(getattr(balance, name) or (), dtype=np.float64)
        if value.size:
            by = np.array([sizes.get(unit, force / length) for unit in of_numbers])
            changed[name] = rows(value * np.resize(by, value.shape[-1:]))
    if balance.pressure_range is not None:
        changed["pressure_range"] = tuple(pressure * end for end in balance.pressure_range)
    return replace(balance, **changed)

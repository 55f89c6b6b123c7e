"""Visco-elasticity: Maxwell branches, each a spring in series with a dashpot, beside the bladder.

Under a held pressure their forces fade and the muscle creeps on; at a held length the pull relaxes.
"""

from __future__ import annotations

from mckibben.rigs.physics.compiled import compiled


@compiled
def relax(force: float, kept: float, drawn: float, moved: float) -> float:
    """Return a branch's force after a step [N]; exact at constant speed.

    ``kept`` is exp(-step/time), ``drawn`` is stiffness time (1 - kept) / step [N/mm].
    """
    return force * kept + drawn * moved

"""Dry friction with presliding: elasto-plastic elements, each a spring in series with a slider.

Several in parallel remember every unfinished excursion (nonlocal memory). The springs are constant;
how far they can be drawn grows with pressure and differs between contraction and extension. As an
element is only ever shortened by slipping, it can never give back more than was put in.
"""

from __future__ import annotations

from mckibben.rigs.physics.compiled import compiled


@compiled
def slip(
    force: float, stiffness: float, contracting: float, extending: float, moved: float
) -> tuple[float, float]:
    """Return an element's force after a move [N], and its slope [N/mm]; exact for a straight move.

    The force resists contraction when positive, up to ``contracting``, and extension when negative,
    down to ``-extending``.
    """
    drawn = force + stiffness * moved
    if drawn > contracting:
        return contracting, 0.0
    if drawn < -extending:
        return -extending, 0.0
    return drawn, stiffness

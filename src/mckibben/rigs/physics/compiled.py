"""Compilation of the physics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from mckibben.system.compiling import deferred

Function = TypeVar("Function", bound=Callable[..., Any])

NEWTON_PER_BAR_MM2 = 0.1
"""Force of one bar on one square millimetre [N]."""

ATMOSPHERE = 1.013
"""Pressure of the atmosphere [bar]."""

GRAVITY = 9.81
"""Weight of one kilogram [N]."""


def compiled(function: Function) -> Function:
    """Compile with exact arithmetic, without global state."""
    return deferred(function)

"""A muscle: braid, bladder, friction, creep and viscosity, in parallel.

    tension = braid pull - bladder - friction - creep - viscosity

A contractile muscle cannot push: where the sum is below what its buckling bears, it goes slack and
stays longer than the distance between its ends.

In every function ``muscle`` is a record of `MUSCLE`, ``state`` one of `MUSCLE_STATE`, ``x`` a shortening
[mm], and ``step`` the time of a step [s].
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mckibben.rigs.physics.bladder import bladder_force
from mckibben.rigs.physics.braid import acting_pressure, braid_area, braid_volume, unfolded
from mckibben.rigs.physics.compiled import NEWTON_PER_BAR_MM2, compiled
from mckibben.rigs.physics.friction import slip

MOST_ELEMENTS = 8
"""Friction elements that a muscle may have."""

MOST_BRANCHES = 4
"""Creep branches that a muscle may have."""

MOST_COORDINATES = 6
"""Coordinates that muscles may act on: three a section of an arm."""

SLACK_TOLERANCE = 1e-9
"""Error of the length of a slack muscle [mm]."""

MOST_STEPS = 100
"""Maximum number of Newton steps to that length."""

MOST_CONTRACTION = 0.6
"""Contraction at which every muscle is slack: no braid pulls so far."""

LEAST_ROOM = 0.05
"""Share of its room at rest that even the longest muscle keeps for air, in its ends."""

MUSCLE = np.dtype(
    [
        ("length", "f8"),  # at rest [mm]
        ("area", "f8"),  # cross-section at rest [mm²]
        ("a", "f8"),  # see `braid_area`
        ("b", "f8"),
        ("end_cap", "f8"),
        ("contact", "f8"),  # pressure over which the bladder reaches the braid [bar]
        ("room", "f8"),  # of air at rest [mm³]
        ("folded", "f8"),  # volume over which the bladder leaves the braid [mm³]
        ("cos2", "f8"),  # squares of the cosine and sine of the threads' angle at rest
        ("sin2", "f8"),
        ("c10", "f8"),  # Mooney and Rivlin's, times the volume of rubber [N mm]
        ("c01", "f8"),
        ("n_elements", "i8"),  # of friction
        ("friction", "f8", (MOST_ELEMENTS,)),  # stiffness [N/mm]
        ("contracting", "f8", (MOST_ELEMENTS,)),  # force at which they slip [N/bar]
        ("extending", "f8", (MOST_ELEMENTS,)),
        ("preload", "f8"),  # normal pressure without air [bar]
        ("beside", "i8"),  # number of the muscle that it is tied to
        ("neighbour", "f8"),  # share of that one's pressure
        ("viscosity", "f8"),  # N s/mm
        ("n_branches", "i8"),
        ("creep", "f8", (MOST_BRANCHES,)),  # N/mm
        ("creep_time", "f8", (MOST_BRANCHES,)),  # s
        ("push", "f8"),  # force that it bears before it buckles [N]
        ("levers", "f8", (MOST_COORDINATES,)),  # shortening by each coordinate
        ("offset", "f8"),  # shortening where all coordinates are 0 [mm]
    ],
    align=True,
)
"""One muscle, as the compiled physics reads it; made by `mckibben.rigs.parameters`."""

MUSCLE_STATE = np.dtype(
    [
        ("x", "f8"),  # own shortening [mm]
        ("speed", "f8"),  # mm/s
        ("pressure", "f8"),  # bar
        ("outlet", "f8"),  # pressure at the regulator's end of the line [bar]
        ("valve", "f8"),
        ("tension", "f8"),
        ("friction", "f8", (MOST_ELEMENTS,)),  # N
        ("creep", "f8", (MOST_BRANCHES,)),  # N
        # constant while a step is solved, see `prepare`:
        ("inside", "f8"),  # pressure [N/mm²]
        ("acting", "f8"),  # pressure on the braid, where the bladder has to reach it [N/mm²]
        ("normal", "f8"),  # pressure that presses friction elements together [bar]
        ("kept", "f8", (MOST_BRANCHES,)),  # see `relax`
        ("drawn", "f8", (MOST_BRANCHES,)),  # N/mm
    ],
    align=True,
)
"""State of one muscle."""


@compiled
def relax(force: float, kept: float, drawn: float, moved: float) -> float:
    """Return the force after a step of a creep branch, spring and dashpot in series [N].

    It is exact at constant speed: ``kept`` is exp(-step/time), ``drawn`` is stiffness time
    (1 - kept) / step [N/mm].
    """
    return force * kept + drawn * moved


@compiled
def prepare(muscle: Any, state: Any, beside: float, step: float) -> None:
    """Compute the quantities that are constant within a step.

    ``beside`` is the pressure of the muscle that this one is tied to [bar].
    """
    acting, _, _ = acting_pressure(state.pressure, muscle.contact)
    state.inside = NEWTON_PER_BAR_MM2 * state.pressure
    state.acting = NEWTON_PER_BAR_MM2 * acting
    pressed = state.pressure + muscle.preload + muscle.neighbour * beside
    state.normal = max(pressed, 0.0)
    for i in range(muscle.n_branches):
        kept = math.exp(-step / muscle.creep_time[i])
        state.kept[i] = kept
        state.drawn[i] = muscle.creep[i] * muscle.creep_time[i] * (1.0 - kept) / step


@compiled
def tension(muscle: Any, state: Any, x: float, step: float) -> tuple[float, float]:
    """Return the pull of a muscle that shortens to ``x`` within a step [N], and its slope [N/mm]."""
    area, area_slope = braid_area(muscle.area, muscle.a, muscle.b, muscle.end_cap, muscle.length, x)
    gained = braid_volume(muscle.area, muscle.a, muscle.b, muscle.end_cap, muscle.length, x)
    _, reaching, change = unfolded(gained, muscle.folded)
    pressure = state.inside + (state.acting - state.inside) * reaching
    pressure_slope = (state.acting - state.inside) * change * area
    rubber, rubber_slope = bladder_force(
        muscle.c10, muscle.c01, muscle.cos2, muscle.sin2, muscle.length, x
    )
    pull = pressure * area - rubber
    slope = pressure * area_slope + pressure_slope * area - rubber_slope

    moved = x - state.x  # mm
    for i in range(muscle.n_elements):
        force, stiffness = slip(
            state.friction[i],
            muscle.friction[i],
            muscle.contracting[i] * state.normal,
            muscle.extending[i] * state.normal,
            moved,
        )
        pull -= force
        slope -= stiffness
    for i in range(muscle.n_branches):
        pull -= relax(state.creep[i], state.kept[i], state.drawn[i], moved)
        slope -= state.drawn[i]
    pull -= muscle.viscosity * moved / step
    slope -= muscle.viscosity / step
    return pull, slope


@compiled
def longest(muscle: Any) -> float:
    """Return the (negative) shortening at which the threads would lie along the axis [mm]."""
    return muscle.length * (1.0 - 0.999 / math.sqrt(muscle.cos2))


@compiled
def taut_or_slack(muscle: Any, state: Any, x: float, step: float) -> tuple[float, float, float]:
    """Return pull [N], slope [N/mm] and own shortening [mm], for ends ``x`` mm closer.

    A taut muscle is as short as its ends are close; a slack one, less, where its pull is what it bears.
    """
    least_pull, most_x = -muscle.push, MOST_CONTRACTION * muscle.length
    if x <= most_x:
        pull, slope = tension(muscle, state, x, step)
        if pull >= least_pull:
            return pull, slope, x

    # the pull falls with shortening: go longer until it is enough
    low, high = min(state.x, x), min(x, most_x)
    reach, lowest = 1e-3, longest(muscle)
    while low > lowest and tension(muscle, state, low, step)[0] < least_pull:
        high = low
        low = max(low - reach, lowest)
        reach *= 2.0

    # Newton's method, by halves where it leaves the bracket
    own = low
    for _ in range(MOST_STEPS):
        pull, slope = tension(muscle, state, own, step)
        if pull >= least_pull:
            low = own
        else:
            high = own
        if high - low <= SLACK_TOLERANCE:
            break
        own -= (pull - least_pull) / slope
        if not low < own < high:
            own = 0.5 * (low + high)
    return least_pull, 0.0, own


@compiled
def commit(muscle: Any, state: Any, x: float, step: float) -> None:
    """Accept a step's move: update friction, creep and position."""
    moved = x - state.x
    for i in range(muscle.n_elements):
        state.friction[i], _ = slip(
            state.friction[i],
            muscle.friction[i],
            muscle.contracting[i] * state.normal,
            muscle.extending[i] * state.normal,
            moved,
        )
    for i in range(muscle.n_branches):
        state.creep[i] = relax(state.creep[i], state.kept[i], state.drawn[i], moved)
    state.speed = moved / step
    state.x = x


@compiled
def chamber(muscle: Any, x: float, pressure: float) -> tuple[float, float, float]:
    """Return the room inside [mm³], its change with shortening [mm²] and with pressure [mm³/bar]."""
    _, share, bend = acting_pressure(pressure, muscle.contact)
    gained = braid_volume(muscle.area, muscle.a, muscle.b, muscle.end_cap, muscle.length, x)
    area, _ = braid_area(muscle.area, muscle.a, muscle.b, muscle.end_cap, muscle.length, x)
    out, reaching, _ = unfolded(gained, muscle.folded)
    room = muscle.room + gained + (share - 1.0) * out
    if room < LEAST_ROOM * muscle.room:
        return LEAST_ROOM * muscle.room, 0.0, 0.0
    return room, (1.0 + (share - 1.0) * reaching) * area, bend * out

"""Mechanics: coordinates with mass, stiffness and friction, and time integration.

The coordinates are few (the end of a muscle; mean shortening and two tilts of a disc, or of two; the
angle of a joint), the muscles act on them through fixed lever arms. Every step solves the balance of
forces at its end by Newton's method, with the accelerations of Hilber, Hughes and Taylor (1977): second
order, and quiet where friction sticks. Air is marched before, in substeps. One coordinate may instead be
driven, as by the screw of a test stand.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.rigs.physics.air import MM3_PER_LITRE, SUBSTEPS, through, valve_target
from mckibben.rigs.physics.compiled import ATMOSPHERE, compiled
from mckibben.rigs.physics.friction import slip
from mckibben.rigs.physics.muscle import (
    MOST_COORDINATES,
    chamber,
    commit,
    longest,
    prepare,
    taut_or_slack,
)

Records = NDArray[np.void]

ALPHA = -0.1
"""Numerical damping of the fastest motion, of Hilber, Hughes and Taylor; 0 is none."""

GAMMA = 0.5 - ALPHA
BETA = 0.25 * (1.0 - ALPHA) ** 2

TOLERANCE = 1e-8
"""A Newton move below this ends the search [mm or rad].

It holds a mass m [t] at rest within a force of m TOLERANCE / (BETA step²).
"""

MOST_ATTEMPTS = 80
"""Newton moves, and halvings of moves that went too far, in one step."""

NO_MUSCLE = -1

MM2_PER_NEWTON_PER_BAR = 10.0
"""A force that grows by 1 N per bar comes from a volume that grows by 10 mm³ per mm."""

_EACH, _EVERY_TWO = (MOST_COORDINATES,), (MOST_COORDINATES, MOST_COORDINATES)

MECHANISM = np.dtype(
    [
        ("n", "i8"),  # coordinates: shortening [mm], then tilts [rad] if any; or an angle [rad]
        ("mass", "f8", _EVERY_TWO),  # t, t mm or t mm²; symmetric
        ("stiffness", "f8", _EVERY_TWO),  # N/mm, or N mm/rad; symmetric
        ("stiffening", "f8", _EACH),  # stiffness that a bar in one muscle adds
        ("stiffened_by", "i8", _EACH),  # that muscle
        ("damping", "f8", _EACH),  # N s/mm, or N mm s/rad
        ("weight", "f8", _EACH),  # N against it
        ("swing", "f8", _EACH),  # weight times lever of a pendulum [N mm]
        ("hanging", "f8", _EACH),  # where it hangs straight down [rad]
        ("guide_stiffness", "f8", _EACH),  # presliding, of the guide's friction [N/mm]
        ("guide_limit", "f8", _EACH),  # N
        ("driven", "i8"),
        ("speed_limit", "f8"),  # of the drive [mm/s]
        ("tolerance", "f8"),  # of a Newton move [mm or rad]
    ],
    align=True,
)
"""What the muscles move, as the compiled physics reads it."""

MOTION = np.dtype(
    [
        ("place", "f8", _EACH),
        ("speed", "f8", _EACH),
        ("acceleration", "f8", _EACH),
        ("balance", "f8", _EACH),  # sum of forces against motion [N]
        ("before", "f8", _EACH),  # that of the step before
        ("guide_force", "f8", _EACH),  # friction of the guide [N]
        # What the solution of a step needs:
        ("tried", "f8", _EACH),
        ("change", "f8", _EACH),
        ("slopes", "f8", _EVERY_TWO),
    ],
    align=True,
)
"""State of the coordinates."""


@compiled
def pressure_of(states: Any, muscle: int) -> float:
    """Return the gauge pressure of a muscle, for what it acts on [bar]; 0 for `NO_MUSCLE`."""
    if muscle < 0:
        return 0.0
    return max(states[muscle].pressure, 0.0)


@compiled
def shortening(muscle: Any, n: int, place: Any) -> float:
    """Return the shortening of a muscle [mm] at given coordinates."""
    x = muscle.offset
    for g in range(n):
        x += muscle.levers[g] * place[g]
    return x


@compiled
def resist(
    muscles: Any, mechanism: Any, states: Any, motion: Any, loads: Array, step: float
) -> None:
    """Compute the resistance of each coordinate at a trial position, and its slopes."""
    n = mechanism.n
    for g in range(n):
        moved = motion.tried[g] - motion.place[g]
        rub, rub_slope = slip(
            motion.guide_force[g],
            mechanism.guide_stiffness[g],
            mechanism.guide_limit[g],
            mechanism.guide_limit[g],
            moved,
        )
        for k in range(n):
            motion.slopes[g, k] = mechanism.stiffness[g, k]
        motion.slopes[g, g] += mechanism.stiffening[g] * pressure_of(
            states, mechanism.stiffened_by[g]
        )
        motion.balance[g] = 0.0
        for k in range(n):
            motion.balance[g] += motion.slopes[g, k] * motion.tried[k]
        damping = mechanism.damping[g] / step
        motion.balance[g] = motion.balance[g] + rub + damping * moved
        motion.balance[g] += mechanism.weight[g] + loads[g]
        tilt = motion.tried[g] - mechanism.hanging[g]
        motion.balance[g] += mechanism.swing[g] * math.sin(tilt)
        swing_slope = mechanism.swing[g] * math.cos(tilt)
        motion.slopes[g, g] = motion.slopes[g, g] + rub_slope + damping + swing_slope
    for j in range(muscles.size):
        x = shortening(muscles[j], n, motion.tried)
        pull, slope, _ = taut_or_slack(muscles[j], states[j], x, step)
        for g in range(n):
            lever = muscles[j].levers[g]
            motion.balance[g] -= lever * pull
            for k in range(n):
                motion.slopes[g, k] -= lever * muscles[j].levers[k] * slope


@compiled
def solve(n: int, matrix: Any, right: Any) -> None:
    """Solve a small positive definite system in place; the solution replaces ``right``."""
    for i in range(n):
        for k in range(i + 1, n):
            share = matrix[k, i] / matrix[i, i]
            right[k] -= share * right[i]
            for m in range(i + 1, n):
                matrix[k, m] -= share * matrix[i, m]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]


@compiled
def within_reach(muscles: Any, n: int, place: Any) -> bool:
    """Return whether all muscles are shorter than their threads."""
    spare = np.inf
    for j in range(muscles.size):
        spare = min(spare, shortening(muscles[j], n, place) - longest(muscles[j]))
    return spare >= 0.0


@compiled
def newmark(motion: Any, g: int, step: float) -> float:
    """Return the acceleration for reaching a trial position."""
    went = motion.tried[g] - motion.place[g] - step * motion.speed[g]
    return went / (BETA * step * step) - (0.5 - BETA) / BETA * motion.acceleration[g]


@compiled
def inertia(mechanism: Any, motion: Any, g: int, step: float) -> float:
    """Return the inertia against a coordinate's motion at a trial position [N, or N mm]."""
    force = 0.0
    for k in range(mechanism.n):
        force += mechanism.mass[g, k] * newmark(motion, k, step)
    return force


@compiled
def move(muscles: Any, mechanism: Any, states: Any, motion: Any, loads: Array, step: float) -> None:
    """Integrate the coordinates over one step, for pressures at its end."""
    n = mechanism.n

    # predictor: on with the speed and acceleration of the step before
    for g in range(n):
        motion.before[g] = motion.balance[g]
        coast = step * motion.speed[g] + 0.5 * step * step * motion.acceleration[g]
        motion.tried[g] = motion.place[g] + coast
        motion.change[g] = coast

    # Newton's method for the balance of forces at the end of the step
    inert = 1.0 / (BETA * step * step)
    last_residual = np.inf
    shrunk = 1.0
    for _ in range(MOST_ATTEMPTS):
        residual = np.inf
        if within_reach(muscles, n, motion.tried):
            resist(muscles, mechanism, states, motion, loads, step)
            residual = 0.0
            for g in range(n):
                off = inertia(mechanism, motion, g, step) + (1.0 + ALPHA) * motion.balance[g]
                off -= ALPHA * motion.before[g]
                residual += off * off / (inert * mechanism.mass[g, g])

        # too far: halfway back, where Newton's straight line is still near the truth
        if residual > last_residual or residual == np.inf:
            shrunk *= 0.5
            if shrunk < 1e-6:
                break
            for g in range(n):
                motion.tried[g] -= shrunk * motion.change[g]
            continue
        last_residual, shrunk = residual, 1.0

        for g in range(n):
            motion.change[g] = ALPHA * motion.before[g] - (1.0 + ALPHA) * motion.balance[g]
            motion.change[g] -= inertia(mechanism, motion, g, step)
            for k in range(n):
                motion.slopes[g, k] *= 1.0 + ALPHA
                motion.slopes[g, k] += inert * mechanism.mass[g, k]
        solve(n, motion.slopes, motion.change)
        largest = 0.0
        for g in range(n):
            largest = max(largest, abs(motion.change[g]))
        if largest <= mechanism.tolerance:
            break
        for g in range(n):
            motion.tried[g] += motion.change[g]

    # speed and acceleration at the end of the step
    for g in range(n):
        acceleration = newmark(motion, g, step)
        mean = (1.0 - GAMMA) * motion.acceleration[g] + GAMMA * acceleration
        motion.speed[g] += step * mean
        motion.acceleration[g] = acceleration


@compiled
def drive(
    muscles: Any, mechanism: Any, states: Any, motion: Any, target: float, step: float
) -> None:
    """Move a driven coordinate towards its target at up to the drive's speed."""
    reach = mechanism.speed_limit * step
    moved = min(max(target - motion.place[0], -reach), reach)
    motion.tried[0] = motion.place[0] + moved
    motion.speed[0] = moved / step


@compiled
def arrive(muscles: Any, mechanism: Any, states: Any, motion: Any, step: float) -> None:
    """Accept the move to the trial position, in the guides and in every muscle."""
    for j in range(muscles.size):
        x = shortening(muscles[j], mechanism.n, motion.tried)
        pull, _, own = taut_or_slack(muscles[j], states[j], x, step)
        states[j].tension = pull
        commit(muscles[j], states[j], own, step)
    for g in range(mechanism.n):
        motion.guide_force[g], _ = slip(
            motion.guide_force[g],
            mechanism.guide_stiffness[g],
            mechanism.guide_limit[g],
            mechanism.guide_limit[g],
            motion.tried[g] - motion.place[g],
        )
        motion.place[g] = motion.tried[g]


@compiled
def squeeze(mechanism: Any, motion: Any, muscle: int) -> tuple[float, float]:
    """Return the volume that a muscle lost by bending [mm³], and its change [mm³/s]."""
    squeezed, squeezing = 0.0, 0.0
    for g in range(mechanism.n):
        if mechanism.stiffened_by[g] == muscle:
            per_place = MM2_PER_NEWTON_PER_BAR * mechanism.stiffening[g]
            squeezed += 0.5 * per_place * motion.place[g] * motion.place[g]
            squeezing += per_place * motion.place[g] * motion.speed[g]
    return squeezed, squeezing


@compiled
def breathe(
    muscle: Any,
    air: Any,
    state: Any,
    before: float,
    after: float,
    squeezed: float,
    squeezing: float,
    step: float,
) -> None:
    """Fill or vent a muscle for a step, with its command changing linearly.

    ``squeezed`` is the volume that the muscle lost by bending [mm³], ``squeezing`` its change [mm³/s].
    """
    dt = step / SUBSTEPS
    half = math.exp(-0.5 * dt / air.valve_time)
    pressure = state.pressure
    for i in range(SUBSTEPS):
        command = before + (after - before) * (i + 0.5) / SUBSTEPS
        target = valve_target(air, command, state.outlet)
        opening = target + (state.valve - target) * half
        state.valve = target + (opening - target) * half
        x = state.x + state.speed * dt * (i + 0.5)
        middle = pressure
        for stage in range(1, 3):
            volume, area, give = chamber(muscle, x, middle)
            volume += air.dead_room - squeezed
            absolute = middle + ATMOSPHERE
            rate = through(air, opening, middle)[0] * MM3_PER_LITRE
            rate -= absolute * (area * state.speed - squeezing)
            middle = pressure + 0.5 * stage * dt * rate / (
                volume / air.polytropic + absolute * give
            )
        pressure = middle
        state.outlet = through(air, state.valve, pressure)[1]
    state.pressure = pressure


@compiled
def advance(
    muscles: Any,
    air: Any,
    mechanism: Any,
    states: Any,
    motion: Any,
    before: Array,
    after: Array,
    loads_before: Array,
    loads_after: Array,
    target_before: float,
    target_after: float,
    steps: int,
    step: float,
) -> None:
    """Integrate from one sample to the next; commands and loads change linearly."""
    loads = np.empty(MOST_COORDINATES)
    for i in range(steps):
        start, end = i / steps, (i + 1) / steps
        for j in range(muscles.size):
            rise = after[j] - before[j]
            squeezed, squeezing = squeeze(mechanism, motion, j)
            breathe(
                muscles[j],
                air,
                states[j],
                before[j] + start * rise,
                before[j] + end * rise,
                squeezed,
                squeezing,
                step,
            )
        for j in range(muscles.size):
            prepare(muscles[j], states[j], pressure_of(states, muscles[j].beside), step)
        if mechanism.driven:
            target = target_before + end * (target_after - target_before)
            drive(muscles, mechanism, states, motion, target, step)
        else:
            for g in range(mechanism.n):
                loads[g] = loads_before[g] + end * (loads_after[g] - loads_before[g])
            move(muscles, mechanism, states, motion, loads, step)
        arrive(muscles, mechanism, states, motion, step)


@compiled
def note(muscles: Any, mechanism: Any, states: Any, motion: Any, row: Array) -> None:
    """Store the measurable quantities in a row: see `march`."""
    n, m = mechanism.n, muscles.size
    for g in range(n):
        row[g] = motion.place[g]
        row[n + g] = motion.acceleration[g]
    for j in range(m):
        row[2 * n + j] = states[j].outlet
        row[2 * n + m + j] = states[j].tension
        volume, _, _ = chamber(muscles[j], states[j].x, states[j].pressure)
        row[2 * n + 2 * m + j] = volume


@compiled
def march(
    muscles: Records,
    air: Records,
    mechanism: Records,
    states: Records,
    motion: Records,
    commands: Array,
    loads: Array,
    targets: Array,
    held: bool,
    steps: int,
    step: float,
    traces: Array,
) -> None:
    """Integrate over all samples, and store the measurable quantities at each.

    Commands have shape (n, muscles) [bar], loads (n, coordinates) [N or N mm], targets (n,) [mm].
    Between two samples they go on in straight lines, or are held at the first. Each row of
    ``traces`` takes place and acceleration of every coordinate, then pressure at the regulator, tension
    and volume [mm³] of every muscle.
    """
    note(muscles, mechanism[0], states, motion[0], traces[0])
    for i in range(commands.shape[0] - 1):
        k = i if held else i + 1
        advance(
            muscles,
            air[0],
            mechanism[0],
            states,
            motion[0],
            commands[i],
            commands[k],
            loads[i],
            loads[k],
            targets[i],
            targets[k],
            steps,
            step,
        )
        note(muscles, mechanism[0], states, motion[0], traces[i + 1])

"""Laws, friction and time steps of drawn plants, from textbook physics alone.

Units are mm, N, s, bar (0.1 N/mm²); masses in kg (1e-3 N s²/mm). All plants are a balance of forces of
one coordinate x: the contraction of the muscle, positive shorter, or pulley radius * angle of a joint::

    m x'' = F(p, x) - kr x - k3 x^3 - K x - K3 x^3 - load - friction - c x' - sum q_i    (muscle)
    m x'' = G(p1, x0 + x) - G(p2, x0 - x) + 1000 torque / radius - friction - c x' - sum q_i    (joint)

G is F without the pull of rubber that is stretched from 2.2 x0. In them:

- F, braid (Chou and Hannaford, 1996; Tondu and Lopez, 2000), e = x / rest length:
  0.1 p pi D²/4 [3/tan²(a) (1 - k e)² - 1/sin²(a)]; ends that do not swell: k (1 + k_low exp(-p/p_low)).
- F, exponential (of Sarosi's kind):
  B (p + s p/(p + 0.5)) [w (exp(-e/d) - exp(-l/d)) + (1 - w) (1 - e/l)].
- F, virtual spring (of Wickramatunge's kind): (s1 p + s2 p²) (l rest (0.75 + 0.25 p/(p + p_half)) - x).
- F, polynomial area: 0.1 p (a0 + a1 x + a2 x²).
- Friction, W one way and ``ratio`` W the other: coulomb (rigid); maxwell_slip (six sliders);
  pressure_scaled (the same, W grows with pressure); dahl, z' = k x' (1 - z sgn(x')/W); lugre (W times
  1 + s exp(-(v/vs)²), and a viscous part); log_rate (W times 1 + r ln(1 + |v|/v0)); bouc_wen (unloads
  along a straight line); smooth_coulomb (W tanh(v/v0)).
- Viscoelasticity: a dashpot; sls, q' = k x' - q/tau; power_law, six to eight of these, k_i ~ tau_i^-n.
- Filling: p' = (command - p)/tau, in some plants limited in speed.
- Wall: a force per mm of depth beyond its place. Dead zone: F(max(0, p - threshold), x).
- Slack: the cable to the spring pulls beyond x = slack only, in series with the spring; in a joint, a
  muscle pulls only where G(p, slack + x0 ± x) > 0.
- Held lengths: F(p, y) - kr y - friction = T = k_end (y - x), so that friction is seen in force too.

Without mass, steps are backward Euler: exact for dry friction, and for Maxwell elements where motion is
straight within a step; dashpots of second order. With mass, steps follow the trapezoidal rule, which
adds no damping. Steps of half the length change x by less than 1e-3 of its range (chirps through a
resonance: 4e-3).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array

BAR = 0.1  # N/mm²

Slope = tuple[float, float]
"""A force [N] and its derivative by x [N/mm]."""

Law = Callable[[float, float], Slope]
"""From pressure and contraction."""

Drive = Callable[[float, Sequence[float], float], Slope]
"""From x, pressures and load: what is left of all forces but friction and viscoelasticity."""


def braid(
    rest: float, diameter: float, angle: float, k: float, k_low: float = 0.0, p_low: float = 1.0
) -> Law:
    """Return the law of a braid, whose ends change it by ``k_low`` at low pressures."""
    area = math.pi * diameter**2 / 4
    a, b = 3 / math.tan(angle) ** 2, 1 / math.sin(angle) ** 2

    def law(p: float, x: float) -> Slope:
        kk = k * (1 + k_low * math.exp(-p / p_low)) / rest if k_low else k / rest
        u = max(0.0, 1 - kk * x)
        return BAR * p * area * (a * u * u - b), -2 * BAR * p * area * a * kk * u

    return law


def exponential(
    rest: float, blocked: float, decay: float, limit: float, share: float, p_shift: float
) -> Law:
    """Return the exponential law."""
    low = share * math.exp(-limit / decay)

    def law(p: float, x: float) -> Slope:
        e = max(-0.5, x / rest)
        f = share * math.exp(-e / decay) - low + (1 - share) * (1 - e / limit)
        d = (-share / decay * math.exp(-e / decay) - (1 - share) / limit) / rest
        return blocked * (p + p_shift * p / (p + 0.5)) * f, blocked * (
            p + p_shift * p / (p + 0.5)
        ) * d

    return law


def virtual_spring(rest: float, s1: float, s2: float, limit: float, p_half: float) -> Law:
    """Return the law of a spring whose stiffness and end depend on pressure."""

    def law(p: float, x: float) -> Slope:
        stiff = s1 * p + s2 * p * p
        end = limit * rest * (0.75 + 0.25 * p / (p + p_half))
        return stiff * (end - x), -stiff

    return law


def polynomial_area(a0: float, a1: float, a2: float) -> Law:
    """Return the law of an area [mm²] that is a polynomial of x."""
    return lambda p, x: (BAR * p * (a0 + x * (a1 + x * a2)), BAR * p * (a1 + 2 * a2 * x))


def with_threshold(law: Law, threshold: float) -> Law:
    """Return a law with a dead zone of pressure."""
    return lambda p, x: law(max(0.0, p - threshold), x)


class Friction(Protocol):
    """A force that opposes motion, with memory."""

    def begin(self, h: float, scale: float) -> None:
        """Begin a step of h [s], in which friction is larger by a factor."""

    def trial(self, d: float) -> Slope:
        """Return the force after a motion of d in the step."""

    def commit(self, d: float) -> None:
        """Keep the state after a motion of d."""


class MaxwellSlip:
    """Springs in series with dry sliders, in parallel."""

    def __init__(self, stiffness: Array, limits: Array, ratio: float = 1.0) -> None:
        self.k, self.w, self.ratio = stiffness.tolist(), limits.tolist(), ratio
        self.z = [0.0] * len(self.k)

    def begin(self, h: float, scale: float) -> None:
        self.up = [w * scale for w in self.w]
        self.down = [-w * scale * self.ratio for w in self.w]

    def trial(self, d: float) -> Slope:
        f = s = 0.0
        for z, k, up, down in zip(self.z, self.k, self.up, self.down, strict=True):
            z += k * d
            if z >= up:
                f += up
            elif z <= down:
                f += down
            else:
                f += z
                s += k
        return f, s

    def commit(self, d: float) -> None:
        moved = (z + k * d for z, k in zip(self.z, self.k, strict=True))
        limits = zip(moved, self.up, self.down, strict=True)
        self.z = [up if z > up else max(z, down) for z, up, down in limits]


class Bristle:
    """A bristle, dz/dx = k (1 - z sgn(v)/g(v)): Dahl (g constant), LuGre, or logarithmic in rate."""

    def __init__(
        self,
        stiffness: float,
        limit: float,
        ratio: float = 1.0,
        stribeck: float = 0.0,
        v_s: float = 1.0,
        log_rate: float = 0.0,
        v_0: float = 1.0,
    ) -> None:
        self.k, self.w, self.ratio = stiffness, limit, ratio
        self.stribeck, self.v_s, self.log_rate, self.v_0 = stribeck, v_s, log_rate, v_0
        self.z = 0.0
        self.rated = bool(stribeck or log_rate)

    def begin(self, h: float, scale: float) -> None:
        self.h, self.scale = h, scale

    def trial(self, d: float) -> Slope:
        g = self.w * self.scale * (1.0 if d >= 0 else self.ratio)
        dg = 0.0
        if self.rated:
            v = abs(d) / self.h
            e = self.stribeck * math.exp(-((v / self.v_s) ** 2))
            dg = g / self.h * (-2 * v / self.v_s**2 * e + self.log_rate / (v + self.v_0))
            g *= 1 + e + self.log_rate * math.log1p(v / self.v_0)
        sign = 1.0 if d >= 0 else -1.0
        end = sign * g
        e = math.exp(-self.k * abs(d) / g)
        return end + (self.z - end) * e, self.k * e * (1 - self.z * sign / g) + dg * (1 - e)

    def commit(self, d: float) -> None:
        self.z = self.trial(d)[0]


class BoucWen:
    """Bouc and Wen's element, which unloads along a straight line and loads exponentially."""

    def __init__(self, stiffness: float, limit: float, ratio: float = 1.0) -> None:
        self.k, self.w, self.ratio, self.z = stiffness, limit, ratio, 0.0

    def begin(self, h: float, scale: float) -> None:
        self.up, self.down = self.w * scale, self.w * scale * self.ratio

    def trial(self, d: float) -> Slope:
        sign = 1.0 if d >= 0 else -1.0
        w = self.up if d >= 0 else self.down
        z, rest = self.z * sign, abs(d)
        if z < 0:
            free = -z / self.k
            if rest <= free:
                return sign * (z + self.k * rest), self.k
            z, rest = 0.0, rest - free
        e = math.exp(-self.k * rest / w)
        return sign * (w + (z - w) * e), self.k * e * max(0.0, 1 - z / w)

    def commit(self, d: float) -> None:
        self.z = self.trial(d)[0]


class SmoothCoulomb:
    """Dry friction that yields a little at any force."""

    def __init__(self, limit: float, v_0: float, ratio: float = 1.0) -> None:
        self.w, self.v_0, self.ratio = limit, v_0, ratio

    def begin(self, h: float, scale: float) -> None:
        self.h, self.scale = h, scale

    def trial(self, d: float) -> Slope:
        w = self.w * self.scale * (1.0 if d >= 0 else self.ratio)
        t = math.tanh(d / self.h / self.v_0)
        return w * t, w * (1 - t * t) / (self.h * self.v_0)

    def commit(self, d: float) -> None:
        pass


@dataclass
class Resistance:
    """What opposes motion.

    Parameters
    ----------
    make : callable
        Returns an element with memory, anew for every run; default none.
    coulomb : (float, float)
        Rigid dry friction of motion up and down [N].
    dashpot : float
        N s/mm.
    prony : sequence of (float, float)
        Stiffness [N/mm] and time [s] of Maxwell elements.
    """

    make: Callable[[], Friction] | None = None
    coulomb: tuple[float, float] = (0.0, 0.0)
    dashpot: float = 0.0
    prony: Sequence[tuple[float, float]] = ()


@dataclass
class Rig:
    """A muscle or joint.

    Parameters
    ----------
    drive : callable
        All forces but those of ``resistance``.
    mass : float
        kg.
    filling, rate : float
        Time constant of the pressure inside [s], and its largest speed, 0 for none [bar/s].
    scale : callable, optional
        Factor of friction by pressures.
    substep : float
        Longest time step [s].
    """

    drive: Drive
    resistance: Resistance
    mass: float = 0.0
    filling: float = 0.0
    rate: float = 0.0
    scale: Callable[[Sequence[float]], float] | None = None
    substep: float = 0.01


def equilibrium(drive: Drive, pressures: Sequence[float], load: float = 0.0) -> float:
    """Return where forces balance without friction [mm]."""
    low, high = -60.0, 150.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if drive(middle, pressures, load)[0] > 0:
            low = middle
        else:
            high = middle
    return middle


class _Motion:
    """A rig that moves, from x = 0 at rest."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.x = self.v = self.a = self.d = 0.0
        self.inertia = 0.0  # N s²/mm
        self.friction = rig.resistance.make() if rig.resistance.make else None
        self.q = [0.0] * len(rig.resistance.prony)

    def take(self, h: float) -> None:
        """Take steps of h [s] from now on."""
        self.h = h
        self.decays = [
            (math.exp(-h / t), k * t / h * (1 - math.exp(-h / t)))
            for k, t in self.rig.resistance.prony
        ]

    def advance(self, pressures: Sequence[float], load: float) -> None:
        """Take a step to pressures and a load."""
        drive, friction, h, x = self.rig.drive, self.friction, self.h, self.x
        damping, (up, down) = self.rig.resistance.dashpot, self.rig.resistance.coulomb
        scale = self.rig.scale(pressures) if self.rig.scale else 1.0
        if friction is not None:
            friction.begin(h, scale)
        base = slope = 0.0  # of forces that are linear in the motion
        for qi, (e, c) in zip(self.q, self.decays, strict=True):
            base += qi * e
            slope += c
        if self.inertia:
            slope += 2 * damping / h
            base -= damping * self.v + self.inertia * (4 * self.v / h + self.a)
            slope += 4 * self.inertia / (h * h)
        else:  # velocity at the end of the step, of second order
            base -= 0.5 * damping * self.d / h
            slope += 1.5 * damping / h

        def residual(there: float) -> Slope:
            d = there - x
            f, k = drive(there, pressures, load)
            f -= base + slope * d
            k -= slope
            if friction is not None:
                own, by_x = friction.trial(d)
                return f - own, k - by_x
            return f, k

        low, high, shift = -math.inf, math.inf, 0.0
        there, sticks = x + self.d, False
        if up or down:
            f = residual(x)[0]
            sticks = -down * scale <= f <= up * scale
            if f > 0:
                low, shift, there = x, up * scale, max(there, x)
            else:
                high, shift, there = x, -down * scale, min(there, x)
        there = x if sticks else _root(residual, there, low, high, shift)
        self.d = d = there - x
        if friction is not None:
            friction.commit(d)
        self.q = [qi * e + c * d for qi, (e, c) in zip(self.q, self.decays, strict=True)]
        if self.inertia:
            self.a = 4 / (h * h) * (d - h * self.v) - self.a
            self.v = 2 * d / h - self.v
        self.x = there


def _root(
    residual: Callable[[float], Slope], there: float, low: float, high: float, shift: float
) -> float:
    """Return where a falling residual is ``shift``, by Newton steps and bisection."""
    for count in range(80):
        f, k = residual(there)
        f -= shift
        if f > 0:
            low = there
        else:
            high = there
        step = -f / k if k < 0 else (1.0 if f > 0 else -1.0)
        if abs(step) < 1e-6:
            return there + step
        new = there + step
        bracketed = low > -math.inf and high < math.inf
        if bracketed and (not low < new < high or (count > 8 and count % 2)):
            new = 0.5 * (low + high)
            if high - low < 1e-8:
                return new
        there = new
    return there


LEAD, LEAD_STEPS, FILLED = 8.0, 200, 0.4
"""Seconds before the first sample, steps in them, and the share in which pressures rise from zero."""


def simulate(
    rig: Rig, pressures: ArrayLike, loads: Array | None, dt: float, mass: float | None = None
) -> tuple[Array, Array]:
    """Return x of every sample, shape (n,), and pressures inside, shape (n, m).

    Parameters
    ----------
    rig : Rig
    pressures : array, shape (n,) or (n, m)
        Commands [bar].
    loads : array, shape (n,), optional
        In the unit of the rig's drive; default 0.
    dt : float
        Sample time [s].
    mass : float, optional
        In place of the rig's [kg].
    """
    pressures = np.atleast_2d(np.asarray(pressures, float).T).T
    n, m = pressures.shape
    rows, carried = pressures.tolist(), [0.0] * n if loads is None else loads.tolist()
    motion, first = _Motion(rig), rows[0]
    motion.take(LEAD / LEAD_STEPS)
    for i in range(LEAD_STEPS):
        part = min(1.0, (i + 1) / (FILLED * LEAD_STEPS))
        motion.advance([part * p for p in first], carried[0])
    motion.inertia, motion.d = 1e-3 * (rig.mass if mass is None else mass), 0.0
    substeps = max(1, math.ceil(dt / rig.substep - 1e-9))
    h = dt / substeps
    motion.take(h)
    inside = list(first)
    xs, insides = np.empty(n), np.empty((n, m))
    xs[0], insides[0] = motion.x, first
    last, last_load = first, carried[0]
    for i in range(1, n):
        row, load = rows[i], carried[i]
        for j in range(1, substeps + 1):
            ends = ((j - 1) / substeps, j / substeps)
            inside = [_filled(rig, *each, ends, h) for each in zip(inside, last, row, strict=True)]
            motion.advance(inside, last_load + (load - last_load) * ends[1])
        last, last_load = row, load
        xs[i], insides[i] = motion.x, inside
    return xs, insides


def _filled(
    rig: Rig, p: float, last: float, following: float, ends: tuple[float, float], h: float
) -> float:
    """Return the pressure inside after a part of the way from one command to the following."""
    tau, rate = rig.filling, rig.rate
    w0, w1 = (last + (following - last) * part for part in ends)
    if rate:
        return p + h * max(-rate, min(rate, (w1 - p) / (tau + h)))
    if tau:  # exact for commands that are straight within a step
        slope = tau * (w1 - w0) / h
        return w1 - slope + (p - w0 + slope) * math.exp(-h / tau)
    return w1

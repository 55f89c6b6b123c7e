"""The law of a balance in plain loops, from its formulas: a reference for its kernels."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

Rows = list[list[float]]


def _sum(weights: tuple[float, ...], states: list[float]) -> float:
    return sum(w * s for w, s in zip(weights, states, strict=True))


def bisect(function: Callable[[float], float], target: float, low: float, high: float) -> float:
    """Return where an increasing function is the target, or the end of the range nearer to it."""
    if function(low) >= target:
        return low
    if function(high) <= target:
        return high
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if function(middle) < target:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


class _Muscles:
    """Muscles in parallel at one place of their history, all as tables of numbers by muscle."""

    def __init__(self, block: Any, scheduled: list[float], sample_time: float) -> None:
        n, m = len(block.given), len(block.driven)
        self.block, self.n, self.m, self.step = block, n, m, sample_time
        self.ways = block.directions or [[float(k == j) for j in range(m)] for k in range(n)]
        self.q, self.u, self.z = [0.0] * m, [0.0] * n, [0.0] * n
        self.stops = [[0.0] * len(block.limits) for _ in range(n)]
        self.behind = [[0.0] * len(block.lags) for _ in range(n)]
        self.moves = [[0.0, 0.0] for _ in range(n)]
        self.way = "rest"
        resting = self.found([0.0] * n, scheduled)
        self.keep(resting, [0.0] * n, scheduled)
        self.tare = resting if block.tare else [0.0] * m
        self.way = "first"

    def shortening(self, k: int, q: list[float]) -> float:
        return math.fsum(w * v for w, v in zip(self.ways[k], q, strict=True))

    def scheduling(self, x: list[float]) -> list[float]:
        return x[: len(x) - len(self.block.loads[0])]

    def outer(self, j: int, q: list[float], x: list[float]) -> float:
        """Return what loads, springs and an obstacle hold a coordinate with."""
        block, m, scheduling = self.block, self.m, self.scheduling(x)
        loads = x[len(scheduling) :]
        force = sum(c * load for c, load in zip(block.loads[j], loads, strict=True))
        for power, x_q in enumerate([1.0] + [v**d for v in scheduling for d in _degrees(block)]):
            row = block.springs[j][power * (1 + m) : (power + 1) * (1 + m)]
            force += x_q * (row[0] + sum(s * v for s, v in zip(row[1:], q, strict=True)))
        if block.obstacles:
            width = 3 + len(scheduling)
            for first in range(0, len(block.obstacles[j]), width):
                side, place, stiff, *by = block.obstacles[j][first : first + width]
                stiffness = stiff + _sum(tuple(by), scheduling)
                force += stiffness * side * max(side * (q[j] - place), 0.0)
        return force

    def area(self, k: int, y: float) -> float:
        terms = self.block.areas[k]
        value = _beyond(
            lambda u: sum(a * u**i for i, a in enumerate(terms)),
            y,
            self.block.hull[k],
            self.block.scale,
        )
        return max(value, 0.01 * terms[0])

    def moved(self, k: int, y: float, p: float, x: list[float]) -> list[float]:
        """Return where a muscle's stops would be."""
        if self.way == "rest":
            return [0.0] * len(self.stops[k])
        block, dz = self.block, y + self.block.walls[k] * p - self.z[k]
        scheduling = self.scheduling(x)
        pressed = p + block.grip + _sum(block.grips or (0.0,) * len(scheduling), scheduling)
        return [
            min(max(s + dz, -(block.asymmetry or 1.0) * width), width)
            for s, width in zip(
                self.stops[k], (limit * max(pressed, 0.0) for limit in block.limits), strict=True
            )
        ]

    def relaxing(self, k: int, y: float) -> list[float]:
        """Return what a muscle's lags would be behind: on a ramp in time, by a step at once."""
        dy, out = y - self.u[k], []
        for q, tau in zip(self.behind[k], self.block.lags, strict=True):
            keep = math.exp(-self.step / tau)
            ramp = tau / self.step * (1.0 - keep)
            first = 0.0 if self.block.settled else dy
            out.append({"rest": 0.0, "first": first, "time": keep * q + ramp * dy}[self.way])
        return out

    def resisted(self, k: int, u: float, p: float, x: list[float]) -> float:
        """Return what a muscle resists shortening with, were it never slack."""
        block = self.block
        force = _beyond(
            lambda v: sum(e * v**i for i, e in enumerate(block.elasticity[k], start=2)),
            u,
            block.hull[k],
            block.scale,
        )
        force += block.bladders[k] * u if block.bladders else 0.0
        force += _sum(block.friction[k], self.moved(k, u, p, x))
        force += _sum(block.relaxation[k], self.relaxing(k, u))
        if self.way == "time":
            low, high = block.hull[k]
            flow = self.area(k, min(max(self.u[k], low), high)) / block.areas[k][0]
            line = block.lines[k] if block.lines else 0.0
            moved, (last, before) = u - self.u[k], self.moves[k]
            force += (block.damping[k] + line * flow**2) * moved / self.step
            heavy = block.mass[k] if block.mass else 0.0
            force += heavy * (2.0 * moved - 3.0 * last + before) / self.step**2
        return force - p * self.area(k, u)

    def push(self, k: int) -> float:
        return self.block.pushes[k] if self.block.pushes else math.inf

    def excess(self, j: int, q: list[float], x: list[float], p: list[float]) -> float:
        """Return how much more muscles pull at a coordinate than they hold."""
        lengths = [self.shortening(k, q) for k in range(self.n)]
        forces = [min(self.resisted(k, lengths[k], p[k], x), self.push(k)) for k in range(self.n)]
        return -self.outer(j, q, x) - _sum(tuple(way[j] for way in self.ways), forces)

    def pressure(self, k: int, q: list[float], x: list[float], force: float) -> float:
        """Return the pressure at which a muscle resists with a force."""
        y = self.shortening(k, q)
        return bisect(lambda p: -self.resisted(k, y, p, x), -force, -1000.0, 1000.0)

    def pressures(self, q: list[float], x: list[float]) -> list[float]:
        low, high = self.block.pressure_range or (-math.inf, math.inf)
        if not self.block.directions:
            wanted = [min(-self.outer(k, q, x), self.push(k)) for k in range(self.n)]
            found = [self.pressure(k, q, x, wanted[k]) for k in range(self.n)]
            return [min(max(p, low), high) for p in found]
        shared = min(max(self.block.preload, low), high)
        p, free = [shared] * self.n, set(range(self.n))
        while True:
            forces = []
            for k in range(self.n):
                way, self.way = self.way, "rest" if k in free else self.way
                p[k] = shared if k in free else p[k]
                resisted = self.resisted(k, self.shortening(k, q), p[k], x)
                forces.append(min(resisted, self.push(k)))
                self.way = way
            pulls = np.array(self.ways).T @ forces
            lacks = np.array([-self.outer(j, q, x) - pulls[j] for j in range(self.m)])
            some = sorted(free)
            more = np.linalg.lstsq(np.array(self.ways)[some].T, lacks, rcond=None)[0]
            ends = {}
            for k, change in zip(some, more.tolist(), strict=True):
                p[k] = self.pressure(k, q, x, forces[k] + change)
                slack = self.pressure(k, q, x, self.push(k)) if self.block.pushes else -math.inf
                ends[k] = min(max(p[k], low, slack), high)
            worst = max(some, key=lambda k: abs(p[k] - ends[k]))
            if abs(p[worst] - ends[worst]) <= 1e-9 or len(free) == self.m:
                return [min(max(value, low), high) for value in p]
            p[worst] = ends[worst]
            free.remove(worst)

    def found(self, p: list[float], x: list[float]) -> list[float]:
        from scipy.optimize import root

        def missed(q: Any) -> list[float]:
            return [self.excess(j, list(q), x, p) for j in range(self.m)]

        return [float(q) for q in root(missed, self.q, tol=1e-14).x]

    def keep(self, q: list[float], p: list[float], x: list[float]) -> None:
        u = [self.shortening(k, q) for k in range(self.n)]
        self.stops = [self.moved(k, u[k], p[k], x) for k in range(self.n)]
        self.behind = [self.relaxing(k, here) for k, here in enumerate(u)]
        if self.way == "time":
            self.moves = [[u[k] - self.u[k], last] for k, (last, _) in enumerate(self.moves)]
        self.z = [
            here + wall * pressure
            for here, wall, pressure in zip(u, self.block.walls, p, strict=True)
        ]
        self.q, self.u, self.way = q, u, "time"


def _degrees(block: Any) -> range:
    return range(1, block.degree + 1)


def _beyond(
    formula: Callable[[float], float], y: float, hull: tuple[float, float], scale: float
) -> float:
    """Return a polynomial of y / scale, and beyond what is known its tangent there.

    Differences of polynomials of the fourth order and below are exact, of steps of any length.
    """
    inside, h = min(max(y, hull[0]), hull[1]), 1.0
    u = inside / scale
    if y == inside:
        return formula(u)
    near, far = (formula(u + d * h) - formula(u - d * h) for d in (1, 2))
    return formula(u) + (8.0 * near - far) / (12.0 * h) * (y - inside) / scale


def balance(block: Any, inputs: Rows, sample_time: float) -> Rows:
    m, out = len(block.driven), []
    arm = _Muscles(block, inputs[0][m:], sample_time)
    for row in inputs:
        q = [here + tare for here, tare in zip(row[:m], arm.tare, strict=True)]
        out.append(arm.pressures(q, row[m:]))
        there = arm.found(out[-1], row[m:]) if block.pressure_range or block.pushes else q
        arm.keep(there, out[-1], row[m:])
    return out


def balance_inverse(block: Any, inputs: Rows, sample_time: float) -> Rows:
    n, out = len(block.forward.given), []
    arm = _Muscles(block.forward, inputs[0][n:], sample_time)
    for row in inputs:
        q = arm.found(row[:n], row[n:])
        arm.keep(q, row[:n], row[n:])
        out.append([here - tare for here, tare in zip(q, arm.tare, strict=True)])
    return out

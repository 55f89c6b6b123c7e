"""Rules of a fuzzy network: its answer to a sample, and the slopes of that by the driven inputs.

An inverse needs the answer and its slopes again and again for the same scheduling inputs. So these are
contracted away once a sample: what is left are rules of the driven inputs alone, each the mean of
those it stands for, weighted by their firing. Slopes are exact, by the product rule: with mu_s the
normalised memberships of an input x_i, of Gaussian sets at c_s of width w_s,

    d ln mu_s / d x_i = sum_r mu_r (x_i - c_r) / w_r^2 - (x_i - c_s) / w_s^2.
"""

from __future__ import annotations

import math

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.kernels import NOTHING, kernel


@kernel
def fill_memberships(x: float, centres: Array, widths: Array, memberships: Array) -> None:
    """Fill an input's normalised memberships; in the log domain, so that none underflow far away."""
    largest, total = -np.inf, 0.0
    for s in range(centres.size):
        z = (x - centres[s]) / widths[s]
        memberships[s] = -0.5 * z * z
        largest = max(largest, memberships[s])
    for s in range(centres.size):
        memberships[s] = math.exp(memberships[s] - largest)
        total += memberships[s]
    for s in range(centres.size):
        memberships[s] /= total


@kernel
def fill_between(c: Array, first: int, last: int, x: Array, memberships: Array) -> int:
    """Fill the memberships of inputs ``first`` to ``last`` alone; return the combinations of their sets.

    ``c`` is what `answer` reads; ``x`` begins at the first of these inputs, memberships at that of all.
    """
    n, most = int(c[0]), int(c[4])
    at, n_sets, combinations = 5 + n, 0, 1
    for i in range(n):
        sets = int(c[5 + i])
        n_sets += sets
        if i < first:
            at += sets
    for i in range(first, last):
        sets = int(c[5 + i])
        fill_memberships(
            x[i - first],
            c[at : at + sets],
            c[at + n_sets : at + n_sets + sets],
            memberships[i * most : i * most + sets],
        )
        combinations *= sets
        at += sets
    return combinations


@kernel
def consequents_at(c: Array) -> int:
    """Return where the consequents begin, behind the sets."""
    n, n_sets = int(c[0]), 0
    for i in range(n):
        n_sets += int(c[5 + i])
    return 5 + n + 2 * n_sets


@kernel
def answer(c: Array, x: Array, memberships: Array, y: Array) -> None:
    """Fill the outputs at one input sample.

    ``c`` is [inputs, outputs, driven, constants, most sets, sets of every input, centres, widths,
    consequents]; a rule's consequents are one row an output: a coefficient for every input, and the
    constant if there are constants.
    """
    n, n_out, constant, most = int(c[0]), int(c[1]), int(c[3]), int(c[4])
    n_rules = fill_between(c, 0, n, x, memberships)
    rows = c[consequents_at(c) :]
    at, width = 0, n + constant
    for j in range(n_out):
        y[j] = 0.0
    for rule in range(n_rules):
        firing, rest = 1.0, rule
        for i in range(n - 1, -1, -1):
            sets = int(c[5 + i])
            firing *= memberships[i * most + rest % sets]
            rest //= sets
        if firing > NOTHING:
            for j in range(n_out):
                total = rows[at + n] if constant else 0.0
                for i in range(n):
                    total += rows[at + i] * x[i]
                y[j] += firing * total
                at += width
        else:
            at += n_out * width


@kernel
def contract(c: Array, m: int, scheduling: Array, memberships: Array, left: Array) -> None:
    """Fill the rules that are left of the first m inputs where the others are known.

    ``left`` has, rule after rule, one row an output: m coefficients and a constant.
    """
    n, n_out, constant, most = int(c[0]), int(c[1]), int(c[3]), int(c[4])
    n_known = fill_between(c, m, n, scheduling, memberships)
    rows, width = c[consequents_at(c) :], n + constant
    for place in range(left.size):
        left[place] = 0.0
    for known in range(n_known):
        firing, rest = 1.0, known
        for i in range(n - 1, m - 1, -1):
            sets = int(c[5 + i])
            firing *= memberships[i * most + rest % sets]
            rest //= sets
        for row in range(left.size // (m + 1)):
            rule, j = row // n_out, row % n_out
            at = ((rule * n_known + known) * n_out + j) * width
            total = rows[at + n] if constant else 0.0
            for i in range(m, n):
                total += rows[at + i] * scheduling[i - m]
            for i in range(m):
                left[row * (m + 1) + i] += firing * rows[at + i]
            left[row * (m + 1) + m] += firing * total


@kernel
def sloped_answer(
    c: Array, left: Array, x: Array, memberships: Array, tilts: Array, y: Array, slopes: Array
) -> None:
    """Fill the outputs at driven inputs, and the slope of every output (row) by each of these.

    ``left`` is what `contract` fills; scratch are the memberships, and beside them their relative
    slopes, with one more for each driven input.
    """
    m, n, most = x.size, int(c[0]), int(c[4])
    n_out = y.size
    n_rules = fill_between(c, 0, m, x, memberships)
    tilt = tilts[m * most :]
    at, n_sets = 5 + n, 0
    for i in range(n):
        n_sets += int(c[5 + i])
    for i in range(m):
        mean = 0.0
        for s in range(int(c[5 + i])):
            width = c[at + n_sets + s]
            tilts[i * most + s] = (x[i] - c[at + s]) / (width * width)
            mean += memberships[i * most + s] * tilts[i * most + s]
        for s in range(int(c[5 + i])):
            tilts[i * most + s] = mean - tilts[i * most + s]
        at += int(c[5 + i])
    for j in range(n_out):
        y[j] = 0.0
        for i in range(m):
            slopes[j, i] = 0.0
    at = 0
    for rule in range(n_rules):
        firing, rest = 1.0, rule
        for i in range(m - 1, -1, -1):
            sets = int(c[5 + i])
            place = i * most + rest % sets
            firing *= memberships[place]
            tilt[i] = tilts[place]
            rest //= sets
        if firing > NOTHING:
            for j in range(n_out):
                total = left[at + m]
                for i in range(m):
                    total += left[at + i] * x[i]
                y[j] += firing * total
                for i in range(m):
                    slopes[j, i] += firing * (left[at + i] + tilt[i] * total)
                at += m + 1
        else:
            at += n_out * (m + 1)

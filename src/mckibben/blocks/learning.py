"""Online estimation of a block's parameters in its inverse: recursive least squares.

With slopes phi of a measured output over the parameters, each in its scale and divided by the scatter of
errors, and P the parameters' covariance,

    r = phi' P phi,   theta <- theta + P phi e / (1 + r),   P^-1 <- P^-1 + b phi phi',
    b = l - (1 - l) / r,   l = 1 - sample time / time:

Information is forgotten along phi alone, as much as arrives (Kulhavy, "Restricted exponential
forgetting in real-time identification", Automatica 23 (1987), 589): r settles at (1 - l) / l, and
no variance exceeds the widest. P is factored as U D U' and updated by Bierman's recursion, so that
it stays positive in single precision.

The scatter is the usual size of errors, which follows their median, times a constant, since errors
of successive samples are correlated. Errors beyond a few times that size count as that size; if
many are too large, the plant has changed suddenly, and the covariance is reset to that of the
start. Measurements that are NaN are ignored, and so is a sensor that is frozen while the reference
moves.

For weighted sums of play operators the slopes are the operators and 1, so nothing is linearised.
The operators' states are in units of the input, and do not change with the weights. There, the
inverse adopts new weights as far as its input then continues in the direction of the reference,
unless the difference exceeds the usual error: a change of weights never acts as a reversal, and
noise does not cause chatter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Start
from mckibben.blocks.hysteresis.play_operators import follow
from mckibben.blocks.kernels import Step, fill, kernel, step


@dataclass(frozen=True)
class Learnable:
    """Linear parameters of a block that are adapted while its inverse runs.

    Parameters
    ----------
    step, start : callable
        Kernels of the adaptive inverse. Inputs of the step are those of the inverse, then the measured
        outputs for the references of the step before, NaN where absent. The state is [the inverse's,
        ``n_more_states``, theta, used, root, senses]: the estimated parameters, those that the inverse
        uses, the covariance as U D U', and the memory of every sensor.
    fitted : array, shape (p,)
        The parameters as fitted, in their units.
    scales : array, shape (p,)
        Unit of changes of each; positive.
    spread : array, shape (p, p)
        Covariance of expected changes, in squares of the scales; positive definite.
    with_parameters : callable
        Returns the forward block with other parameters, shape (p,).
    numbers : callable
        Returns the coefficients that follow the learner's (see `family_at`), given the sample time.
    known : array, shape (n_outputs, 2), optional
        Lowest and highest outputs where it was fitted, if known.
    compensates : bool
        Whether the block is itself the compensator that runs, and its inverse the model.
    n_more_states : int
        Number of states after the inverse's.
    n_more_scratch : int
        Scratch in addition to three numbers a parameter and that of the inverse.
    """

    step: Step
    start: Start
    fitted: Array
    scales: Array
    spread: Array
    with_parameters: Callable[[Array], Block]
    numbers: Callable[[float | None], Array]
    known: Array | None = None
    compensates: bool = False
    n_more_states: int = 1
    n_more_scratch: int = 0


SENSES = 5
"""Stored values per sensor: number of updates modulo p, usual size of its errors, their mean square
relative to that, last measurement, and the prediction when that changed.
"""

READY, USUAL, SURPRISE, LAST, THEN = range(SENSES)

N_LEARNED, SHARE, NOISE, SCALES = range(4)
"""Places of the first coefficients of a learner: number of parameters, sample time / time, scatter of
errors, and what `family_at` describes.
"""

GATE = 3.0
"""Innovation, in usual errors, beyond which a measurement counts as one of that size."""
CORRELATED = 10.0
"""Square root of how many errors, each like the last, count as one independent error."""
QUARTILE = 0.6745
"""Median absolute error of a unit-variance normal distribution."""
SINGLE = {"LEAST_WEIGHT": 1e-6, "LEAST_INFORMATION": 1e-9, "LEAST_SLOPE": 1e-12}
"""Constants with a different value in single precision."""
NEAR = 0.1
"""Width of the transition at the gate, so that single and double precision decide alike."""
LEAST_WEIGHT = 1e-6
"""Weight of an error too large to be plausible."""
LARGEST_ERROR = 1e9
"""Largest usual error, relative to the noise."""
NEVER = 1e30
"""Value that no output takes."""
LEAST_INFORMATION, LEAST_SLOPE = 1e-9, 1e-12
"""Smallest information, and squared slope relative to the noise, below which parameters do not
change.
"""
SURPRISED = 5.0
"""Mean squared error (clipped at the gate), relative to the usual one, above which adaptation
restarts.
"""


@kernel
def learn(
    c: Array,
    adapted: Array,
    place: int,
    slopes: Array,
    work: Array,
    measured: float,
    predicted: float,
    asked: float,
) -> bool:
    """Update the parameters by one measured output; return whether they changed.

    Parameters
    ----------
    c : array
        Coefficients of a learner, see `family_at`.
    adapted : array
        [theta, used, root, senses], changed.
    place : int
        Which of the outputs is measured.
    slopes : array, shape (p,)
        Of the output over the parameters.
    work : array, shape (2 p,)
        Scratch.
    measured, predicted, asked : float
        The output, its prediction by ``theta``, and by the parameters that the inverse uses.
    """
    p, share, noise = int(c[N_LEARNED]), c[SHARE], c[NOISE]
    scales, widest = c[SCALES : SCALES + p], c[SCALES + p : SCALES + 2 * p]
    fresh = c[SCALES + 3 * p : family_at(c)]
    theta, root = adapted[:p], adapted[2 * p : 2 * p + fresh.size]
    first = 2 * p + fresh.size + place * SENSES
    sense = adapted[first : first + SENSES]
    if measured - measured != 0.0:
        return False
    if sense[READY] == 0.0:
        sense[READY], sense[LAST], sense[THEN] = 1.0, measured, asked
        return False
    usual = sense[USUAL]
    if measured != sense[LAST]:
        sense[LAST], sense[THEN] = measured, asked
    elif abs(asked - sense[THEN]) > GATE * usual:
        sense[THEN] = NEVER  # frozen until it changes
        return False
    if sense[SURPRISE] > SURPRISED:  # the plant has stepped
        for i in range(fresh.size):
            root[i] = fresh[i]
        sense[SURPRISE] = 1.0
    error = measured - predicted
    f, g = work[:p], work[p : 2 * p]
    r = 0.0
    scatter = CORRELATED * usual
    for j in range(p):
        f[j] = slopes[j] * scales[j] / scatter
    for j in range(p - 1, -1, -1):  # U' phi in place
        first = p + (j * (j - 1)) // 2
        for i in range(j):
            f[j] += root[first + i] * f[i]
        g[j] = root[j] * f[j]
        r += f[j] * g[j]
    expected = math.sqrt(usual * usual + r * scatter * scatter)
    weight = 1.0
    if abs(error) > GATE * expected:
        weight = GATE * expected / abs(error)
    update_size(share, noise, weight * error / expected, sense)
    if not LEAST_SLOPE < r < np.inf or weight < LEAST_WEIGHT:
        return False
    settled = share / (1.0 - share)
    lacks = r < settled  # as where errors have grown: then it adapts within the time
    excess = 1.0 / settled - 1.0 / r
    r *= weight
    update_root(root, f, g, excess if lacks else weight * (1.0 - share - share / r))
    gain = weight * error / scatter / (1.0 + r)
    for i in range(p):
        theta[i] += scales[i] * g[i] * gain
    turn = int(sense[READY]) % p
    bound_variance(root, widest, turn)
    sense[READY] = turn + 1.0
    return True


@kernel
def update_size(share: float, noise: float, relative: float, sense: Array) -> None:
    """Update the usual size of errors, near their median, by one relative to its expected size."""
    usual = sense[USUAL]
    quick = min(20.0 * share, 0.5)
    side = min(max((abs(relative) - QUARTILE) / NEAR, -1.0), 1.0)
    sense[USUAL] = min(max(usual * (1.0 + 0.5 * quick * side), noise), LARGEST_ERROR * noise)
    sense[SURPRISE] += quick * (relative * relative - sense[SURPRISE])


@kernel
def update_root(root: Array, f: Array, g: Array, excited: float) -> None:
    """Update the factored covariance; ``g`` becomes P phi."""
    p = f.size
    still = abs(excited) < LEAST_INFORMATION
    before = 0.0 if still else 1.0 / excited
    first = p
    for j in range(p):
        after = before + f[j] * g[j]
        known = 0.0
        if not still:
            known = -f[j] / before
            root[j] *= before / after
        for i in range(j):
            u = root[first + i]
            root[first + i] = u + g[i] * known
            g[i] += u * g[j]
        first += j
        before = after


@kernel
def bound_variance(root: Array, widest: Array, i: int) -> None:
    """Bound the variance of one parameter, each in turn."""
    p = widest.size
    variance = root[i]
    first = p + (i * (i + 1)) // 2
    for j in range(i + 1, p):
        variance += root[first + i] * root[first + i] * root[j]
        first += j
    if variance <= widest[i]:
        return
    less = math.sqrt(widest[i] / variance)
    root[i] *= less * less
    own = p + (i * (i - 1)) // 2
    for k in range(i):
        root[own + k] /= less
    first = p + (i * (i + 1)) // 2
    for j in range(i + 1, p):
        root[first + i] *= less
        first += j


@kernel
def pull_back(c: Array, adapted: Array, along: Array, work: Array) -> None:
    """Pull unobservable parameters back to the fitted ones within the adaptation time.

    It is weighed as if the fit were measured too: by the covariance, over the widest. ``along`` and
    ``work`` have a number a parameter to compute in.
    """
    p = along.size
    for i in range(p):
        work[i] = (
            c[SHARE] * (c[SCALES + 2 * p + i] - adapted[i]) / (c[SCALES + i] * c[SCALES + p + i])
        )
    covariant(adapted, work, along)
    for i in range(p):
        adapted[i] += c[SCALES + i] * along[i]


@kernel
def covariant(adapted: Array, vector: Array, product: Array) -> None:
    """Multiply by the covariance U D U'."""
    p = product.size
    root = adapted[2 * p : 2 * p + root_size(p)]
    first = p + (p * (p - 1)) // 2
    for j in range(p - 1, -1, -1):
        first -= j
        total = vector[j]
        for i in range(j):
            total += root[first + i] * vector[i]
        product[j] = root[j] * total
    first = p
    for j in range(p):
        for i in range(j):
            product[i] += root[first + i] * product[j]
        first += j


def start_root(covariance: Array) -> Array:
    """Return [D, U] of a covariance, shape (p, p): U D U', U upper with ones on its diagonal."""
    p = len(covariance)
    left = np.array(covariance, dtype=np.float64)
    upper, diagonal = np.eye(p), np.empty(p)
    for j in reversed(range(p)):
        diagonal[j] = left[j, j]
        upper[:j, j] = left[:j, j] / diagonal[j]
        left[:j, :j] -= diagonal[j] * np.outer(upper[:j, j], upper[:j, j])
    return np.concatenate([diagonal, *(upper[:j, j] for j in range(p))])


@kernel
def root_size(p: int) -> int:
    """Return the number of entries of the factored covariance of p parameters."""
    return (p * (p + 1)) // 2


@kernel
def family_at(c: Array) -> int:
    """Return the index of the family's coefficients in an adaptive block.

    These are [p, sample time / time, noise, scales (p), widest variances in squares of them (p), fitted
    parameters (p), covariance at the start as root], then the family's. A root is [D, columns of U above
    its diagonal of ones], p (p + 1) / 2 numbers.
    """
    p = int(c[N_LEARNED])
    return SCALES + 3 * p + root_size(p)


@kernel
def start_learning(c: Array, adapted: Array) -> None:
    """Start adaptation, [theta, used, root, senses], with the fitted parameters."""
    p, noise = int(c[N_LEARNED]), c[NOISE]
    fitted, fresh = c[SCALES + 2 * p : SCALES + 3 * p], c[SCALES + 3 * p : family_at(c)]
    fill(adapted[:p], fitted)
    fill(adapted[p : 2 * p], fitted)
    fill(adapted[2 * p : 2 * p + fresh.size], fresh)
    senses = adapted[2 * p + fresh.size :]
    senses[:] = 0.0
    for first in range(0, senses.size, SENSES):
        senses[first + USUAL], senses[first + SURPRISE] = 3.0 * noise, 1.0


# -- of weighted sums of play operators ---------------------------------------------------------------

LEAST_SHARE = 0.1
"""Smallest share of a fitted partial sum of weights that adaptation leaves."""


@kernel
def inverse_at(c: Array) -> int:
    """Return the index of the inverse's coefficients, after [limits, least]."""
    return family_at(c) + 2 * int(c[N_LEARNED])


@kernel
def follow_learning(
    c: Array,
    r: Array,
    s: Array,
    last: Array,
    adapted: Array,
    scratch: Array,
    y: float,
    measured: float,
) -> float:
    """Adapt, find the operators' common input for a reference, and return its direction.

    Parameters and weights in use are [weights, offset]; ``s`` are the operators; ``last`` is [previous
    reference, samples clipped, direction of travel].
    """
    n, p, family = r.size, r.size + 1, family_at(c)
    limits, least = c[family : family + 2], c[family + 2 : inverse_at(c)]
    theta, used = adapted[:p], adapted[p : 2 * p]
    sense = adapted[family - SCALES - p :]
    work, slopes = scratch[: 2 * p], scratch[2 * p : 3 * p]
    predicted, asked = theta[n], used[n]
    for i in range(n):
        slopes[i] = s[i]
        predicted += theta[i] * s[i]
        asked += used[i] * s[i]
    slopes[n] = 1.0
    if learn(c, adapted, 0, slopes, work, measured, predicted, asked):
        keep_rising(theta, least)
    if y > last[0]:
        last[2] = 1.0
    elif y < last[0]:
        last[2] = -1.0
    take_over(theta, used, s, y, last[2], GATE * sense[USUAL])
    total = 0.0
    for i in range(n):
        total += used[i] * s[i]
    way, clipped = follow(y - used[n], total, limits[0], limits[1], r, used[:n], s)
    if clipped:
        last[1] += 1.0
    last[0] = y
    return way


def learning_kernels(
    inverse_start: Start, take: Callable[..., float], before: int
) -> tuple[Step, Start]:
    """Return step and start of an inverse that adapts its weights and an offset.

    ``take(way, c, state, n)`` takes, and returns, the input of the operators' edge where the reference
    goes a way, by the inverse's coefficients, whose thresholds are from 3 on; between operators and
    previous reference its state has ``before`` numbers.
    """

    def adaptive_step(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Advance the inverse, and adapt weights and offset to measurements."""
        n = int(coefficients[N_LEARNED]) - 1
        own = coefficients[inverse_at(coefficients) :]
        last, adapted = state[n + before : n + before + 3], state[n + before + 3 :]
        way = follow_learning(
            coefficients, own[3 : n + 3], state[:n], last, adapted, scratch, inputs[0], inputs[1]
        )
        outputs[0] = take(way, own, state, n)

    def adaptive_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
        """Start as the inverse does, with the fitted weights."""
        last = int(coefficients[N_LEARNED]) - 1 + before
        own = coefficients[inverse_at(coefficients) :]
        inverse_start(own, state[: last + 2], inputs, virgin)
        state[last + 2] = 0.0
        start_learning(coefficients, state[last + 3 :])

    return step(adaptive_step), kernel(adaptive_start)


@kernel
def keep_rising(theta: Array, least: Array) -> None:
    """Raise weights that are too small for a sum that increases after every reversal."""
    n = theta.size - 1
    total = 0.0
    for i in range(n):
        theta[i] = max(theta[i], least[i], least[n + i] - total)
        total += theta[i]


@kernel
def take_over(aim: Array, used: Array, s: Array, y: float, travel: float, band: float) -> None:
    """Move the used weights to the estimated ones, without reversing the input."""
    n = s.size
    total, change = used[n], aim[n] - used[n]
    for i in range(n):
        total += used[i] * s[i]
        change += (aim[i] - used[i]) * s[i]
    room = y - total
    share = 1.0
    left = room - change
    if travel * left < 0.0 and abs(left) <= band and change != 0.0:
        share = min(max(room / change, 0.0), 1.0)
    for i in range(n + 1):
        used[i] = aim[i] if share == 1.0 else used[i] + share * (aim[i] - used[i])


def learnable_operators(
    model: Block,
    thresholds: Sequence[float],
    weights: Sequence[float],
    limits: tuple[float, float],
    offset: float,
    step: Step,
    start: Start,
    with_parameters: Callable[[Array], Block],
) -> Learnable:
    """Return the adaptive parameters of a sum of play operators: its weights, and an offset.

    Gain and friction are expected to change by 30 %, each weight by itself by 10 %, the offset by 30 %
    of the span; ``limits`` are the lowest and highest input of the operators.
    """
    r, w = np.array(thresholds), np.array(weights)
    n, size, width = len(w), np.abs(w), limits[1] - limits[0]
    span = float(np.sum(w) * (width if np.isfinite(width) else r.max() or 1.0))
    all_weights, sliding = np.append(np.ones(n), 0.0), np.array([0.0, *np.ones(n - 1), 0.0])
    together = 0.3**2 * np.outer(all_weights, all_weights) + 0.3**2 * np.outer(sliding, sliding)
    lowest = np.where(w >= 0, 0.0, -np.inf)
    least = np.concatenate([lowest, LEAST_SHARE * np.cumsum(w)])  # of weights, then of partial sums

    def numbers(sample_time: float | None) -> Array:
        return np.concatenate([limits, least, model.inverse().coefficients(sample_time)])

    return Learnable(
        step,
        start,
        fitted=np.append(w, offset),
        scales=np.append(np.maximum(size, 0.01 * size.mean()), span),
        spread=together + np.diag([*np.full(n, 0.1**2), 0.3**2]),
        with_parameters=with_parameters,
        numbers=numbers,
    )

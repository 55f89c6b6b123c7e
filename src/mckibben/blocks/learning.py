"""Online estimation of a block's parameters in its inverse: recursive least squares.

With slopes phi of a measured output over the parameters, each in its scale and by the scatter of errors,
and P the parameters' covariance,

    r = phi' P phi,   theta <- theta + P phi e / (1 + r),   P^-1 <- P^-1 + b phi phi',
    b = l - (1 - l) / r,   l = 1 - sample time / time:

what is known is forgotten along phi alone, as much as comes in (Kulhavy, "Restricted exponential
forgetting in real-time identification", Automatica 23 (1987), 589): r settles at (1 - l) / l, and no
variance passes the widest. P is held as U D U', changed by Bierman's recursion, and so stays positive in
single precision.

The scatter is the usual size of errors (it follows their median), times the root of how many that follow
one another tell as much as an independent one. Errors beyond a few times that size count as that size;
where many are too large, the plant has stepped, and the covariance is made as wide as at the start.
Measurements that are not a number teach nothing, nor does one that stands still while the reference
moves.

What is learnt is used as far as it helps: the inverse runs with parameters between the fitted and the
learnt ones, where late errors would have been least.

Of weighted sums of play operators the slopes are the operators and 1, so nothing is linearised. They
play in the space of the input, and stay as they are where weights move. There, what is learnt is taken
over as far as the input then goes on in the direction of the reference, unless it differs by more than
the usual error: a change of weights is never mistaken for a reversal, and noise does not chatter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.hysteresis.play_operators import follow
from mckibben.blocks.kernels import Step, fill, kernel, step

if TYPE_CHECKING:
    from mckibben.blocks.base import Block, Start
    from mckibben.blocks.hysteresis.gpi import GPI
    from mckibben.blocks.hysteresis.pi import PI


@dataclass(frozen=True)
class Group:
    """Parameters that drift together: their name, and the names of an increase and a decrease."""

    name: str
    more: str = "higher"
    less: str = "lower"


@dataclass(frozen=True)
class Learnable:
    """Linear parameters of a block that are adapted while its inverse runs.

    Parameters
    ----------
    step, start : callable
        Kernels of the adaptive inverse. Inputs of the step are those of the inverse, then the outputs
        that answer the references of the step before, NaN where absent; it computes in scratch. The
        state is [the inverse's, ``n_more_states``, theta, used, root, senses]: the parameters as
        learnt, those that the inverse runs with, the covariance as U D U', and what is remembered
        of every sensor.
    fitted : array, shape (p,)
        The parameters as fitted, in their units.
    scales : array, shape (p,)
        Size of a change of each that counts as a whole; positive.
    spread : array, shape (p, p)
        Covariance of changes to be expected, in squares of the scales; definite.
    with_parameters : callable
        Returns the forward block with other parameters, shape (p,).
    numbers : callable
        Returns the coefficients that follow the learner's (see `family_at`), given the sample time.
    groups : tuple of Group
        In which drift is reported.
    group_changes : callable
        Returns the relative change of every group from the fitted one, given parameters.
    whole_changes : array, shape (n_groups,)
        How far an output moves where a group changes by the whole of it; infinite if unknown.
    known : array, shape (n_outputs, 2), optional
        Lowest and highest outputs where it was fitted, if known.
    compensates : bool
        Whether the block is itself the compensator that runs, and its inverse the model.
    n_more_states : int
        Numbers of the last sample that the step remembers behind the inverse's state.
    n_more_scratch : int
        Numbers it computes in, beside three a parameter and those of the inverse.
    """

    step: Step
    start: Start
    fitted: Array
    scales: Array
    spread: Array
    with_parameters: Callable[[Array], Block]
    numbers: Callable[[float | None], Array]
    groups: tuple[Group, ...]
    group_changes: Callable[[Array], Array]
    whole_changes: Array
    known: Array | None = None
    compensates: bool = False
    n_more_states: int = 1
    n_more_scratch: int = 0


SENSES = 12
"""Number of stored values per sensor: whether it was read, usual error, surprise, last measurement,
the prediction when that changed, product and square of errors, last error, whether ignored, squared
scatter of the covariance, product of misfit and correction, and square of the correction.
"""

READY, USUAL, SURPRISE, LAST, THEN, RELATED, SQUARED, BEFORE, IGNORED, STOOD = range(10)
HELPED, APART = 10, 11

GATE = 3.0
"""Innovation, in usual errors, above which a measurement is rejected."""
QUARTILE = 0.6745
"""Median absolute error of a unit-variance normal distribution."""
SINGLE = {"ABSURD": 1e-6, "STILL": 1e-9, "UNMOVED": 1e-12}
"""Constants with a different value in single precision."""
NEAR = 0.1
"""Width of the transition at the gate, so that single and double precision decide alike."""
ABSURD = 1e-6
"""Weight of an error too large to be plausible."""
ALIKE, MOST_ALIKE = 0.98, 0.9995
"""Correlation of successive errors: initial value, and maximum."""
LARGEST = 1e9
"""Largest usual error, relative to the noise."""
NEVER = 1e30
"""Value that no output takes."""
STILL, UNMOVED = 1e-9, 1e-12
"""Smallest information, and squared slope relative to the noise, below which parameters do not
change.
"""
LATE = 3.0
"""Recent errors are averaged over the adaptation time divided by this."""
SURPRISED = 5.0
"""Mean squared error (clipped at the gate), relative to the usual one, above which adaptation
restarts.
"""


@kernel
def learn(
    c: Array,
    learnt: Array,
    place: int,
    slopes: Array,
    work: Array,
    measured: float,
    predicted: float,
    asked: float,
    fitted: float,
) -> bool:
    """Update the parameters by one measured output; return whether they changed.

    Parameters
    ----------
    c : array
        Coefficients of a learner, see `family_at`.
    learnt : array
        [theta, used, root, senses], changed.
    place : int
        Which of the outputs is measured.
    slopes : array, shape (p,)
        Of the output over the parameters.
    work : array, shape (2 p,)
        To compute in.
    measured, predicted, asked, fitted : float
        The output, what it is by ``theta``, by what the inverse runs with, and by what was fitted.
    """
    p, share, noise = int(c[0]), c[1], c[2]
    scales, widest, fresh = c[4 : 4 + p], c[4 + p : 4 + 2 * p], c[4 + 3 * p : family_at(c)]
    theta, root = learnt[:p], learnt[2 * p : 2 * p + fresh.size]
    first = 2 * p + fresh.size + place * SENSES
    sense = learnt[first : first + SENSES]
    if measured - measured != 0.0:
        sense[IGNORED] += 1.0
        return False
    if sense[READY] == 0.0:
        sense[READY], sense[LAST], sense[THEN] = 1.0, measured, asked
        return False
    usual = sense[USUAL]
    if measured != sense[LAST]:
        sense[LAST], sense[THEN] = measured, asked
    elif abs(asked - sense[THEN]) > GATE * usual:
        sense[THEN] = NEVER  # it stands until it changes
        sense[IGNORED] += 1.0
        return False
    if sense[SURPRISE] > SURPRISED:  # the plant has stepped
        for i in range(fresh.size):
            root[i] = fresh[i]
        sense[SURPRISE] = 1.0
    error = measured - predicted
    f, g = work[:p], work[p : 2 * p]
    r = 0.0
    told = usual * math.sqrt(fewer(sense))
    _stand_by(told * told, share, c[3], root[:p], sense)
    for j in range(p):
        f[j] = slopes[j] * scales[j] / told
    for j in range(p - 1, -1, -1):  # U' phi in place
        first = p + (j * (j - 1)) // 2
        for i in range(j):
            f[j] += root[first + i] * f[i]
        g[j] = root[j] * f[j]
        r += f[j] * g[j]
    expected = math.sqrt(usual * usual + r * told * told)
    weight = 1.0
    if abs(error) > GATE * expected:
        weight = GATE * expected / abs(error)
        sense[IGNORED] += 1.0
    _feel(share, noise, weight * error / expected, sense)
    _compare(share, noise, weight * error, predicted - fitted, sense)
    if not UNMOVED < r < np.inf or weight < ABSURD:
        return False
    settled = share / (1.0 - share)
    lacks = r < settled  # as where errors have grown: what is excited is learnt within the time
    tells = 1.0 / settled - 1.0 / r
    r *= weight
    _spread(root, f, g, tells if lacks else weight * (1.0 - share - share / r))
    gain = weight * error / told / (1.0 + r)
    for i in range(p):
        theta[i] += scales[i] * g[i] * gain
    turn = int(sense[READY]) % p
    _bound(root, widest, turn)
    sense[READY] = turn + 1.0
    return True


@kernel
def _stand_by(square: float, share: float, part: float, diagonal: Array, sense: Array) -> None:
    """Scale the covariance with the scatter, at once if that grows, to follow slow drift."""
    stood = sense[STOOD]
    stands = square if square > stood else stood + share * (square - stood)
    grows = 1.0 + part * (stands / stood - 1.0)
    for i in range(diagonal.size):
        diagonal[i] *= grows
    sense[STOOD] = stands


@kernel
def fewer(sense: Array) -> float:
    """Return the number of correlated errors equivalent to one independent error."""
    alike = min(max(sense[RELATED] / sense[SQUARED], 0.0), MOST_ALIKE)
    return (1.0 + alike) / (1.0 - alike)


@kernel
def _feel(share: float, noise: float, relative: float, sense: Array) -> None:
    """Store an error, normalised by its expected size."""
    usual = sense[USUAL]
    quick = min(20.0 * share, 0.5)
    side = min(max((abs(relative) - QUARTILE) / NEAR, -1.0), 1.0)
    sense[USUAL] = min(max(usual * (1.0 + 0.5 * quick * side), noise), LARGEST * noise)
    square = relative * relative
    sense[SURPRISE] += quick * (square - sense[SURPRISE])
    sense[RELATED] += share * (relative * sense[BEFORE] - sense[RELATED])
    sense[SQUARED] += share * (square - sense[SQUARED])
    sense[BEFORE] = relative


@kernel
def _compare(share: float, noise: float, left: float, made_up: float, sense: Array) -> None:
    """Store how adaptation would have helped: the remaining and the corrected error."""
    late = min(LATE * share, 0.5)
    sense[HELPED] += late * (made_up * (left + made_up) - sense[HELPED])
    sense[APART] += late * (made_up * made_up + noise * noise - sense[APART])


@kernel
def trusted(senses: Array) -> float:
    """Return the step from fitted to adapted parameters that would have minimised the errors."""
    helped, apart = 0.0, 0.0
    for first in range(0, senses.size, SENSES):
        helped += senses[first + HELPED]
        apart += senses[first + APART]
    return min(max(helped / apart, 0.0), 1.0)


@kernel
def _spread(root: Array, f: Array, g: Array, excited: float) -> None:
    """Update the factored covariance; ``g`` becomes P phi."""
    p = f.size
    still = abs(excited) < STILL
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
def _bound(root: Array, widest: Array, i: int) -> None:
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
def pull_back(c: Array, learnt: Array, along: Array, work: Array) -> None:
    """Pull unobservable parameters back to the fitted ones within the adaptation time.

    It is weighed as if the fit were measured too: by the covariance, over the widest. ``along`` and
    ``work`` have a number a parameter to compute in.
    """
    p = along.size
    for i in range(p):
        work[i] = c[1] * (c[4 + 2 * p + i] - learnt[i]) / (c[4 + i] * c[4 + p + i])
    covariant(learnt, work, along)
    for i in range(p):
        learnt[i] += c[4 + i] * along[i]


@kernel
def covariant(learnt: Array, vector: Array, product: Array) -> None:
    """Multiply by the covariance U D U'."""
    p = product.size
    root = learnt[2 * p : 2 * p + root_size(p)]
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


def covariance_of(root: Array, p: int) -> Array:
    """Return U D U', shape (p, p)."""
    upper, first = np.eye(p), p
    for j in range(p):
        upper[:j, j] = root[first : first + j]
        first += j
    return np.asarray((upper * root[:p]) @ upper.T)


@kernel
def root_size(p: int) -> int:
    """Return the number of entries of the factored covariance of p parameters."""
    return (p * (p + 1)) // 2


@kernel
def family_at(c: Array) -> int:
    """Return the index of the family's coefficients in an adaptive block.

    These are [p, sample time / time, noise, share of one output among those measured, scales (p),
    widest variances in squares of them (p), fitted parameters (p), covariance at the start as root],
    then the family's. A root is [D, columns of U above its diagonal of ones], p (p + 1) / 2 numbers.
    """
    p = int(c[0])
    return 4 + 3 * p + root_size(p)


@kernel
def start_learning(c: Array, learnt: Array) -> None:
    """Start adaptation, [theta, used, root, senses], with the fitted parameters."""
    p, noise = int(c[0]), c[2]
    fitted, fresh = c[4 + 2 * p : 4 + 3 * p], c[4 + 3 * p : family_at(c)]
    fill(learnt[:p], fitted)
    fill(learnt[p : 2 * p], fitted)
    fill(learnt[2 * p : 2 * p + fresh.size], fresh)
    senses = learnt[2 * p + fresh.size :]
    senses[:] = 0.0
    for first in range(0, senses.size, SENSES):
        senses[first + USUAL], senses[first + SURPRISE] = 3.0 * noise, 1.0
        senses[first + SQUARED], senses[first + RELATED] = 1.0, ALIKE
        senses[first + STOOD] = (3.0 * noise) ** 2 * (1.0 + ALIKE) / (1.0 - ALIKE)
        senses[first + APART] = noise**2


# -- of weighted sums of play operators ---------------------------------------------------------------

LEAST = 0.1
"""Smallest share of a fitted partial sum of weights that adaptation leaves."""

GROUPS = (
    Group("gain", "higher (softer springs, or more area)", "lower (stiffer springs, or less area)"),
    Group("friction"),
    Group("offset", "up", "down"),
)


@kernel
def inverse_at(c: Array) -> int:
    """Return the index of the inverse's coefficients, after [limits, least]."""
    return family_at(c) + 2 * int(c[0])


@kernel
def follow_learning(
    c: Array,
    r: Array,
    s: Array,
    last: Array,
    learnt: Array,
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
    fitted = c[4 + 2 * p : 4 + 3 * p]
    theta, used = learnt[:p], learnt[p : 2 * p]
    sense = learnt[family - 4 - p :]
    work, slopes = scratch[: 2 * p], scratch[2 * p : 3 * p]
    believed, asked, expected = theta[n], used[n], fitted[n]
    for i in range(n):
        slopes[i] = s[i]
        believed += theta[i] * s[i]
        asked += used[i] * s[i]
        expected += fitted[i] * s[i]
    slopes[n] = 1.0
    if learn(c, learnt, 0, slopes, work, measured, believed, asked, expected):
        keep_rising(theta, least)
    if y > last[0]:
        last[2] = 1.0
    elif y < last[0]:
        last[2] = -1.0
    share = trusted(sense)
    for i in range(p):
        slopes[i] = fitted[i] + share * (theta[i] - fitted[i])
    take_over(slopes, used, s, y, last[2], GATE * sense[USUAL])
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
        n = int(coefficients[0]) - 1
        own = coefficients[inverse_at(coefficients) :]
        last, learnt = state[n + before : n + before + 3], state[n + before + 3 :]
        way = follow_learning(
            coefficients, own[3 : n + 3], state[:n], last, learnt, scratch, inputs[0], inputs[1]
        )
        outputs[0] = take(way, own, state, n)

    def adaptive_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
        """Start as the inverse does, with the fitted weights."""
        last = int(coefficients[0]) - 1 + before
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
    model: PI | GPI,
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
    r, w = np.array(model.thresholds), np.array(model.weights)
    n, size, width = len(w), np.abs(w), limits[1] - limits[0]
    span = float(np.sum(w) * (width if np.isfinite(width) else r.max() or 1.0))
    weights, sliding = np.append(np.ones(n), 0.0), np.array([0.0, *np.ones(n - 1), 0.0])
    together = 0.3**2 * np.outer(weights, weights) + 0.3**2 * np.outer(sliding, sliding)
    lowest = np.where(w >= 0, 0.0, -np.inf)
    least = np.concatenate([lowest, LEAST * np.cumsum(w)])  # of weights, then of partial sums

    def numbers(sample_time: float | None) -> Array:
        own = model.inverse_numbers(model.coefficients(sample_time))
        return np.concatenate([limits, least, own])

    def group_changes(theta: Array) -> Array:
        """Return the changes of sum w, of sum w r over sum w, and of the offset over the span."""
        new = theta[:-1]
        width_new, width_old = new @ r / new.sum(), w @ r / w.sum()
        friction = width_new / width_old - 1 if width_old > 0 else 0.0
        return np.array([new.sum() / w.sum() - 1, friction, (theta[-1] - offset) / span])

    return Learnable(
        step,
        start,
        fitted=np.append(w, offset),
        scales=np.append(np.maximum(size, 0.01 * size.mean()), span),
        spread=together + np.diag([*np.full(n, 0.1**2), 0.3**2]),
        with_parameters=with_parameters,
        numbers=numbers,
        groups=GROUPS,
        group_changes=group_changes,
        whole_changes=np.array([span, 2 * np.dot(w, r), span]),
    )

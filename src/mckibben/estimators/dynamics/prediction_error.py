"""Prediction-error minimisation of linear models: stable Gauss-Newton from many starts.

A(q) y = B(q) / F(q) u + C(q) / D(q) e; of several inputs, the sum of B_i / F_i u_i. Residuals are
one-step prediction errors e = D / C (A y - B / F u - start), where the start is what the state before
the first sample adds: a rest at the first input (of a free run, C = D = 1), nothing, or, with a noise
model or with A, a free response estimated with the rest, one to each run. The noise starts from nothing.

The start of every run is linear in the errors and solved for in each evaluation, so the search runs in
the polynomials alone; a step to unstable poles is refused. Starts are the ARX model improved by
Steiglitz and McBride's iteration, lags and oscillations of a few speeds, and random lags. A noise model
is identified last, from the plant found without it.

Source: Ljung, "System Identification", 1999, chapters 4 and 7.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations_with_replacement
from typing import Literal

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.runs import Run
from mckibben.numerics.descent import trust_region
from mckibben.numerics.multi_start import follow_best
from mckibben.numerics.statistics import rms
from mckibben.numerics.tracker import Tracker

STABLE = 1.0 - 1e-7
"""Largest magnitude of a pole."""

INVERTIBLE = 1.0 - 1e-7
"""Largest magnitude of a root of C."""

FIRST_STEPS, FOLLOWED, STEPS = 8, 3, 60
"""Evaluations from every start; number of distinct best starts that are continued; evaluations of each.
"""

NOISE_SAMPLES = 2000
"""Samples of every run used for the noise model of a start."""

SAME = 1e-6
"""Relative difference of equal errors."""

LEAST_RESPONSE = 1e-13
"""Smallest share of a start's response at the samples used for which it is estimated."""

LEAST_GAIN = 2e-9
"""Smallest relative reduction of the squared error for another step."""

Beginning = Literal["estimated", "first_sample", "virgin"]
"""State before the first sample: estimated; at rest at the first input; at rest at an input of zero.

Equation errors (of models with A) need no state: outputs before are measured, and the first few
samples, which have none before them, are left out of account by a start that is always estimated.
"""


@dataclass(frozen=True)
class Orders:
    """Number of coefficients of each polynomial, without leading ones."""

    b: int
    a: int = 0
    f: int = 0
    c: int = 0
    d: int = 0
    delay: int = 0
    """Delay of the first coefficient of B [samples]."""

    lags: tuple[int, ...] | None = None
    """Lags of B's coefficients [samples], instead of successive ones after the delay."""

    inputs: int = 1
    """Number of inputs, each with its own B and, in some models, F."""

    @property
    def input_lags(self) -> tuple[int, ...]:
        """Lags of the coefficients of B in samples."""
        return self.lags or tuple(range(self.delay, self.delay + self.b))

    @property
    def zeros(self) -> int:
        """Number of coefficients of B over all inputs."""
        return self.inputs * self.b

    @property
    def recursions(self) -> int:
        """Number of recursions from inputs to output: the one of A, or the F of every input."""
        return 1 if self.a else self.inputs

    @property
    def poles(self) -> int:
        """Number of coefficients of all recursions."""
        return self.a + self.inputs * self.f

    @property
    def size(self) -> int:
        """Number of parameters: B, poles, C, D and a constant."""
        return self.zeros + self.poles + self.c + self.d + 1


@dataclass(frozen=True)
class Polynomials:
    """The coefficients after a leading 1, and the constant.

    ``b`` has a row for every input, ``poles`` for every recursion.
    """

    b: Array
    poles: Array
    c: Array
    d: Array
    constant: float

    @classmethod
    def of(cls, theta: Array, orders: Orders) -> Polynomials:
        """Return the polynomials of a parameter vector."""
        sizes = np.cumsum([orders.zeros, orders.poles, orders.c, orders.d])
        b, poles, c, d, constants = np.split(theta, sizes)
        n = orders.recursions
        return cls(b.reshape(orders.inputs, -1), poles.reshape(n, -1), c, d, float(constants[0]))

    @property
    def monic(self) -> tuple[Array, ...]:
        """All monic polynomials, without their leading 1: recursions, C and D."""
        return (*self.poles, self.c, self.d)


def delayed(x: Array, samples: int) -> Array:
    """Return a signal that comes so many samples later, after zeros."""
    result = np.zeros_like(x)
    result[samples:] = x[: x.size - samples] if samples else x
    return result


def recursion(denominator: Array, x: Array) -> Array:
    """Return a signal filtered from rest by 1 / denominator."""
    from scipy.signal import lfilter

    return np.asarray(lfilter([1.0], denominator, x))


@dataclass(frozen=True, eq=False)
class Whitening:
    """The filter D / C, which turns A y - B / F u - start into prediction errors.

    ``c`` and ``d`` have their leading 1.
    """

    c: Array
    d: Array

    def __call__(self, x: Array) -> Array:
        """Return a filtered signal."""
        from scipy.signal import lfilter

        return np.asarray(lfilter(self.d, self.c, x))


@dataclass(frozen=True)
class Contribution:
    """What one input adds to the output, and derivatives of the prediction errors.

    A filter at rest answers what comes later as much later, so each derivative is filtered once, and
    `delayed`.

    Parameters
    ----------
    output : array, shape (n,)
    constant : float
        To be added to the output.
    by_input, by_rest : array, shape (n,)
        By a coefficient of B without lag, through the input over that at rest, and through a rest at 1.
    by_poles, by_start : tuple of array, shape (n,)
        By every coefficient of the input's own recursion, and by every state of an estimated start.
    """

    output: Array
    constant: float
    by_input: Array
    by_rest: Array
    by_poles: tuple[Array, ...] = ()
    by_start: tuple[Array, ...] = ()


def free_response(
    poles: Array, driven: Array, u: Array, rest_input: float, whiten: Whitening
) -> Contribution:
    """Return the contribution of an input through 1 / F from an estimated start.

    Parameters
    ----------
    poles : array
        F, with its leading 1.
    driven, u : array, shape (n,)
        B u and the start, without what a rest adds to them, and u.
    rest : float
        B u at rest.
    """
    states = range(poles.size - 1)
    output = recursion(poles, driven + rest_input)
    by_output = whiten(recursion(poles, output))
    by_impulse = -whiten(recursion(poles, np.eye(1, u.size)[0]))
    return Contribution(
        output,
        0.0,
        by_input=-whiten(recursion(poles, u)),
        by_rest=-whiten(recursion(poles, np.ones(u.size))),
        by_poles=tuple(delayed(by_output, i + 1) for i in states),
        by_start=tuple(delayed(by_impulse, i) for i in states),
    )


def response_from_rest(
    poles: Array, driven: Array, u: Array, rest_input: float, whiten: Whitening
) -> Contribution:
    """Return the contribution of an input through 1 / F from rest; arguments as of `free_response`."""
    output, total = recursion(poles, driven), float(poles.sum())
    by_output = whiten(recursion(poles, output))
    by_rest = -whiten(np.ones(u.size)) / total
    return Contribution(
        output,
        rest_input / total,
        by_input=-whiten(recursion(poles, u)),
        by_rest=by_rest,
        by_poles=tuple(
            delayed(by_output, i + 1) - rest_input / total * by_rest for i in range(poles.size - 1)
        ),
    )


def errors(
    theta: Array,
    orders: Orders,
    run: Run,
    start: Beginning = "estimated",
    state: Array | None = None,
    *,
    before: float = 0.0,
    only_starts: bool = False,
) -> tuple[Array, Array]:
    """Return the prediction errors of a run, and derivatives by theta and by its start.

    e = D / C (A y - B / F u - start), of several inputs with the sum of all B_i / F_i u_i.

    Parameters
    ----------
    state : array, shape (poles,), optional
        The start, where it is estimated: what is added to the input of the recursion from input to
        output at the first samples. Default is nothing.
    before : float
        Input at which the model was at rest before a start at rest, above the first one.
    only_starts : bool
        Leave out the derivatives by theta.

    Returns
    -------
    errors : array, shape (n,)
    jacobian : array, shape (n, size + poles)
        By theta, then by the start of this run, in which the errors are linear; without the latter
        where the start is not estimated.
    """
    p = Polynomials.of(theta, orders)
    whiten = Whitening(np.array([1.0, *p.c]), np.array([1.0, *p.d]))
    by_constant = -whiten(np.ones(len(run)))
    residual, by_poles, by_start = _equation_terms(p, orders, run, whiten)
    states = None if state is None else state.reshape(-1, p.poles.shape[1])

    by_b: list[Array] = []
    for number, b in enumerate(p.b):
        input_ = run.driven[:, number]
        rest = 0.0 if start == "virgin" else float(input_[0]) + before
        u = input_ - rest
        lagged_inputs = (
            coefficient * delayed(u, lag)
            for lag, coefficient in zip(orders.input_lags, b, strict=True)
        )
        driven = sum(lagged_inputs, np.zeros(u.size))
        if states is not None and number < len(states):
            driven[: states.shape[1]] += states[number, : u.size]

        output_at_rest = float(b.sum()) * rest
        if orders.a:
            part = Contribution(driven, output_at_rest, -whiten(u), by_constant)
        else:
            poles = np.array([1.0, *p.poles[number]])
            respond = free_response if start == "estimated" else response_from_rest
            part = respond(poles, driven, u, output_at_rest, whiten)

        residual = residual - part.output - part.constant
        by_b += [delayed(part.by_input, lag) + rest * part.by_rest for lag in orders.input_lags]
        by_poles += part.by_poles
        by_start += part.by_start

    residual = residual - p.constant
    e = whiten(residual)
    if only_starts:
        return e, np.column_stack([np.empty((e.size, 0)), *by_start])
    by_noise = _by_noise(e, residual, orders, whiten)
    return e, np.column_stack([*by_b, *by_poles, *by_noise, by_constant, *by_start])


def _equation_terms(
    p: Polynomials, orders: Orders, run: Run, whiten: Whitening
) -> tuple[Array, list[Array], list[Array]]:
    """Return A y, and derivatives of the errors by A and by the start; without A, y alone."""
    from scipy.signal import lfilter

    if not orders.a:
        return run.y, [], []
    by_output, by_impulse = whiten(run.y), -whiten(np.eye(1, len(run))[0])
    states = range(p.poles.shape[1])
    return (
        np.asarray(lfilter([1.0, *p.poles[0]], [1.0], run.y)),
        [delayed(by_output, i + 1) for i in states],
        [delayed(by_impulse, i) for i in states],
    )


def _by_noise(e: Array, residual: Array, orders: Orders, whiten: Whitening) -> list[Array]:
    """Return derivatives of the errors by the coefficients of C, then of D."""
    by_error, by_residual = recursion(whiten.c, e), recursion(whiten.c, residual)
    by_c = [-delayed(by_error, i + 1) for i in range(orders.c)]
    by_d = [delayed(by_residual, i + 1) for i in range(orders.d)]
    return [*by_c, *by_d]


def spectral_radius(tail: Array) -> float:
    """Return the largest magnitude of the roots of a monic polynomial."""
    if tail.size == 0 or not np.isfinite(tail).all():
        return 0.0 if tail.size == 0 else np.inf
    if tail.size > 2:
        return float(np.abs(np.roots([1.0, *tail])).max())
    a, b = float(tail[0]), float(tail[1]) if tail.size == 2 else 0.0
    inner = a * a - 4.0 * b
    return 0.5 * (abs(a) + inner**0.5) if inner >= 0 else b**0.5


def inside(tail: Array, radius: float) -> Array:
    """Return a monic polynomial with outer roots reflected to within a radius.

    Reflection at the unit circle leaves the spectrum of a noise as it is, but for a factor.
    """
    if spectral_radius(tail) < radius:
        return tail
    roots = np.roots([1.0, *tail])
    outside = np.abs(roots) > 1.0
    roots[outside] = 1.0 / roots[outside].conj()
    size = np.abs(roots)
    far = size >= radius
    roots[far] *= radius * (1.0 - 1e-9) / size[far]
    return np.asarray(np.real(np.poly(roots))[1:], dtype=np.float64)


def admissible(theta: Array, orders: Orders) -> bool:
    """Return whether poles, and the roots of C and D, are admissible."""
    p = Polynomials.of(theta, orders)
    return (
        bool(np.isfinite(theta).all())
        and all(spectral_radius(tail) < STABLE for tail in p.poles)
        and spectral_radius(p.c) < INVERTIBLE
        and spectral_radius(p.d) <= 1.0 + 1e-9
    )


def evaluate(
    theta: Array, orders: Orders, runs: Sequence[Run], start: Beginning = "estimated"
) -> tuple[Array, Array, float]:
    """Return errors, derivatives with optimal starts, and the RMSE at scored samples."""
    errors_of_runs, slopes = [], []
    for run in runs:
        # how the start's own response moves with theta counts too: slopes are taken at the start found
        e, starts = errors(theta, orders, run, start, only_starts=True)
        if not starts.shape[1]:
            e, run_slopes = from_rest(theta, orders, run, start)
            e, run_slopes = e[run.counts], run_slopes[run.counts]
        else:
            states, responses = known_starts(starts, run.counts)
            e, jacobian = errors(theta, orders, run, start, -states @ (responses.T @ e[run.counts]))
            e, run_slopes = e[run.counts], jacobian[run.counts, : orders.size]
            e = e - responses @ (responses.T @ e)
            run_slopes = run_slopes - responses @ (responses.T @ run_slopes)
        errors_of_runs.append(e)
        slopes.append(run_slopes)
    e = np.concatenate(errors_of_runs)
    return e, np.concatenate(slopes), rms(e)


def from_rest(theta: Array, orders: Orders, run: Run, start: Beginning) -> tuple[Array, Array]:
    """Return the errors of a free run that begins at rest, and derivatives by theta.

    Where the first output is known, it was at rest at the input that explains it (of several inputs, at
    the first ones): then that error is 0.
    """
    e, slopes = errors(theta, orders, run, start)
    if start == "virgin" or orders.inputs > 1 or not run.counts[0]:
        return e, slopes
    by_rest = errors(theta, orders, run, start, before=1.0)[0] - e
    if by_rest[0] == 0.0:
        return e, slopes
    e, slopes = errors(theta, orders, run, start, before=-e[0] / by_rest[0])
    return e, slopes - np.outer(by_rest / by_rest[0], slopes[0])


def known_starts(free: Array, counts: Mask, least: float = LEAST_RESPONSE) -> tuple[Array, Array]:
    """Return the start responses that scored samples determine, each with its values at these.

    Parameters
    ----------
    free : array, shape (n, k)
        What a unit of every state adds to the errors.
    counts : array of bool, shape (n,)
        Samples that are scored.
    least : float
        Norm there of a start's response whose norm is 1, from which it is determined.

    Returns
    -------
    states : array, shape (k, r)
    responses : array, shape (number of samples scored, r)
        Orthonormal.
    """
    size = np.maximum(np.linalg.norm(free, axis=0), 1e-300)
    responses, spread, turned = np.linalg.svd(free / size, full_matrices=False)
    moved = spread > 1e-12 * spread[0]
    left_vectors, norms, right = np.linalg.svd(
        responses[np.ix_(counts, moved)], full_matrices=False
    )
    determined = norms > least
    states = (
        turned[moved].T @ (right[determined] / spread[moved]).T / norms[determined] / size[:, None]
    )
    return np.asarray(states), np.asarray(left_vectors[:, determined])


def minimise(
    runs: Sequence[Run],
    orders: Orders,
    starts: Sequence[Array],
    tracker: Tracker,
    start: Beginning = "estimated",
) -> Array:
    """Return the best parameters found from all starts."""
    tracker.budget = len(starts) * FIRST_STEPS + FOLLOWED * STEPS

    n_errors = sum(int(run.counts.sum()) for run in runs)

    def sloped(theta: Array) -> tuple[Array, Callable[[], Array]]:
        e, slopes = np.full(n_errors, np.inf), np.empty((n_errors, 0))
        if admissible(theta, orders):
            e, slopes, _ = evaluate(theta, orders, runs, start)
        return e, lambda: slopes

    search = partial(trust_region, tracker.watched(sloped), least_gain=LEAST_GAIN)

    def first_steps(theta: Array) -> tuple[Array, float]:
        best, squares = search(theta, max_evaluations=FIRST_STEPS)[-1]
        return best, float(np.sqrt(squares))

    starting = (theta for theta in starts if admissible(theta, orders))
    follow_best(starting, first_steps, partial(search, max_evaluations=STEPS), FOLLOWED, SAME)
    return tracker.found


def arx(runs: Sequence[Run], orders: Orders) -> Array:
    """Return the least-squares ARX model: linear, so found at once."""
    e, jacobian, _ = evaluate(np.zeros(orders.size), orders, runs)
    return np.asarray(-np.linalg.lstsq(jacobian, e, rcond=1e-12)[0])


def filtered(run: Run, numerator: Sequence[float], denominator: Sequence[float]) -> Run:
    """Return a run with filtered inputs and outputs."""
    from scipy.signal import lfilter

    driven, outputs = (
        np.asarray(lfilter(numerator, denominator, x, axis=0)) for x in (run.driven, run.outputs)
    )
    return replace(run, driven=driven, outputs=outputs)


def starting_points(
    runs: Sequence[Run], stretches: Sequence[Run], orders: Orders, n_starts: int, seed: int
) -> list[Array]:
    """Return initial parameters without noise model: ARX, typical lags and oscillations, random lags.

    ARX uses past outputs, so it is found on ``known`` segments, whose samples are all scored.
    """
    rng = np.random.default_rng(seed)
    n = orders.a + orders.f
    trials = [
        _steiglitz_mcbride(stretches, orders, rounds) for rounds in (0, 1, 3, 10) if stretches
    ]
    speeds = [[0.2], [0.9], [0.99, 0.9], [0.9995, 0.97]]
    turns = np.exp(1j * np.array([0.03, 0.2, 1.0]))
    oscillating = [[0.98 * z, 0.98 * z.conj(), 0.97, 0.2] for z in turns] if n > 1 else []
    roots = [np.resize(speed, n) * (1 - 1e-3 * np.arange(n)) for speed in speeds]
    roots += [np.append(poles, np.full(max(n - 4, 0), 0.2))[:n] for poles in oscillating]
    while len(trials) + len(roots) < n_starts:
        roots.append(1 - 10 ** rng.uniform(-4, 0, n))
    trials += [np.real(np.poly(poles))[1:] for poles in roots]
    return [_complete(poles, orders, runs) for poles in trials if spectral_radius(poles) < STABLE]


def _complete(poles: Array, orders: Orders, runs: Sequence[Run]) -> Array:
    """Return parameters with given poles, and the best B and constant."""
    theta = np.zeros(orders.size)
    theta[orders.zeros : orders.zeros + orders.poles] = np.tile(poles, orders.recursions)
    places = [*range(orders.zeros), orders.size - 1]
    e, jacobian, _ = evaluate(theta, orders, runs)
    theta[places] -= np.linalg.lstsq(jacobian[:, places], e, rcond=1e-12)[0]
    return theta


def with_noise(plant: Array, orders: Orders, runs: Sequence[Run]) -> Array:
    """Return parameters of a plant found without noise model, and a noise model of its residuals."""
    own = replace(orders, c=0, d=0)
    residuals = []
    for run in runs:
        e, jacobian = errors(plant, own, run)
        starts = jacobian[:, own.size :]
        residuals.append(e - starts @ np.linalg.lstsq(starts, e, rcond=1e-10)[0])
    return np.concatenate([plant[:-1], arma(residuals, orders.c, orders.d), plant[-1:]])


def arma(series: Sequence[Array], n_c: int, n_d: int) -> Array:
    """Return C and D, without leading ones, of noise C / D e: the best of several C."""
    from scipy.signal import lfilter

    short = [v[:NOISE_SAMPLES] for v in series]
    best, coefficients = np.inf, np.zeros(n_c + n_d)
    for c in _tried(n_c):
        filtered = [np.asarray(lfilter([1.0], [1.0, *c], v)) for v in short]
        now = np.concatenate(filtered)
        past = np.concatenate([lagged(v, n_d) for v in filtered])
        d = inside(-np.linalg.lstsq(past.T @ past, past.T @ now, rcond=1e-14)[0], 1.0)
        cost = float(np.mean((now + past @ d) ** 2))
        if cost < best:
            best, coefficients = cost, np.concatenate([c, d])
    return coefficients


def _tried(order: int) -> list[Array]:
    """Return polynomials with one or two non-zero roots, spread over the unit disc."""
    radii = (-0.999, -0.97, -0.8, -0.4, 0.4, 0.8, 0.97, 0.999)
    roots: list[list[complex]] = [[]]
    if order >= 1:
        roots += [[r] for r in radii]
    if order >= 2:
        roots += [list(pair) for pair in combinations_with_replacement(radii, 2)]
        turns = np.exp(1j * np.array([0.1, 0.5, 1.0, 1.6, 2.2, 2.7]))
        roots += [[r * z, r * z.conj()] for r in (0.6, 0.9, 0.99) for z in turns]
    padded = [np.append(poles, np.zeros(order - len(poles))) for poles in roots]
    return [np.asarray(np.real(np.poly(poles))[1:], dtype=np.float64) for poles in padded]


def lagged(x: Array, lags: int) -> Array:
    """Return lags 1 to n of x, shape (n, lags)."""
    padded = np.concatenate([np.zeros(lags), x])
    columns = [padded[lags - k : padded.size - k] for k in range(1, lags + 1)]
    return np.column_stack([np.empty((x.size, 0)), *columns])


def _steiglitz_mcbride(runs: Sequence[Run], orders: Orders, rounds: int) -> Array:
    """Return the poles of one recursion by iterated ARX on filtered data."""
    simple = replace(orders, a=orders.a + orders.f, f=0, c=0, d=0)
    poles = np.zeros(simple.a)
    for _ in range(rounds + 1):
        model = arx([filtered(run, [1.0], [1.0, *poles]) for run in runs], simple)
        poles = inside(Polynomials.of(model, simple).poles[0], STABLE * (1 - 1e-4))
    return poles

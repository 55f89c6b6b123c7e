"""Other libraries that identify models from recordings, each called as its documentation does.

None is in this project's environment: they are imported when they are used, and typed as anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfiltic

Array = NDArray[np.float64]

Run = tuple[Array, Array]
"""Inputs (n, k) and outputs (n, m) of a recording, of zero mean and unit variance in training."""

Simulate = Callable[[Array, Array], Array]
"""From inputs (n, k) and the first p measured outputs (p, m) to outputs (n, m), free from p on."""

Settings = Mapping[str, Any]

START = 20
"""Measured outputs that a peer is given to start from; also the most lags that any may have."""

MOST_KNOWN = 200
"""Known outputs, the last ones, that the state of a linear model is found from."""

MOST_TERMS = 30


@dataclass(frozen=True)
class Trial:
    """A recording to run free on.

    Parameters
    ----------
    inputs, outputs : array, shape (n, k), (n, m)
    known : int
        Outputs from its beginning that a model may be told.
    """

    inputs: Array
    outputs: Array
    known: int

    def run(self, simulate: Simulate) -> Array:
        """Return the outputs (n, m) of a model, those known as they were measured."""
        known = self.outputs[: self.known]
        found = np.asarray(simulate(self.inputs, known), dtype=float)
        return np.vstack([known, found[self.known :]])


Fit = Callable[[Sequence[Run], Settings, Sequence[Trial]], Simulate]
"""From training runs, settings, and trials to stop a training early by, which most have no use for."""


@dataclass(frozen=True)
class Peer:
    """A way to identify a model.

    Parameters
    ----------
    name, package : str
    fit : callable
    grid : tuple of mapping
        Settings to search among, cheapest first.
    default : mapping or None
        Settings that the package's own defaults fill up; None where it has none.
    note : str
        What was done to give it what it takes.
    one_input : bool
        Whether it takes no more.
    """

    name: str
    package: str
    fit: Fit
    grid: tuple[Settings, ...]
    default: Settings | None
    note: str
    one_input: bool = False


def grid(**choices: Sequence[Any]) -> tuple[Settings, ...]:
    """Return all combinations of settings, the last varying fastest."""
    return tuple(dict(zip(choices, values, strict=True)) for values in product(*choices.values()))


def joined(runs: Sequence[Run]) -> Run:
    """Return runs end to end, for libraries that take one."""
    return np.vstack([u for u, _ in runs]), np.vstack([y for _, y in runs])


def ahead(u: Array, how: Settings) -> Array:
    """Return inputs a sample early, if settings say so: a model with delay then sees the present."""
    return np.vstack([u[1:], u[-1:]]) if how.get("present") else u


def each_output(fit: Fit) -> Fit:
    """Return a fit of one model for each output, by one that has one output only."""

    def fitted(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
        models = [
            fit([(u, y[:, [place]]) for u, y in runs], how, trials)
            for place in range(runs[0][1].shape[1])
        ]

        def simulate(u: Array, known: Array) -> Array:
            return np.hstack([one(u, known[:, [k]]) for k, one in enumerate(models)])

        return simulate

    return fitted


def _recursive(model: Any, lag: int, how: Settings) -> Simulate:
    """Return what simulates a model of sysidentpy, told no more outputs than its lags."""

    def simulate(u: Array, known: Array) -> Array:
        first = len(known) - lag
        found = model.predict(X=ahead(u, how)[first:], y=known[first:])
        return np.vstack([known[:first], np.reshape(found, (-1, 1))])

    return simulate


def _lags(n: int, inputs: int) -> Any:
    """Return lags of inputs as sysidentpy takes them: a number, or of several a list for each."""
    return n if inputs == 1 else [list(range(1, n + 1)) for _ in range(inputs)]


def polynomial(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit sysidentpy's polynomial NARX, its terms selected by FROLS."""
    del trials
    structure = import_module("sysidentpy.model_structure_selection")
    basis = import_module("sysidentpy.basis_function")
    estimators = import_module("sysidentpy.parameter_estimation")
    u, y = joined(runs)
    lag, degree = int(how.get("lags", 2)), int(how.get("degree", 2))
    candidates = math.comb(lag * (1 + u.shape[1]) + degree, degree)
    chosen = {"estimator": estimators.LeastSquares()} if how else {}
    model = structure.FROLS(
        ylag=lag,
        xlag=_lags(lag, u.shape[1]),
        basis_function=basis.Polynomial(degree=degree),
        n_info_values=min(MOST_TERMS if how else 15, candidates),
        **chosen,
    )
    model.fit(X=ahead(u, how), y=y)
    return _recursive(model, lag, how)


def network(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit sysidentpy's NARX network as its documentation does: two hidden layers, one step ahead."""
    del trials
    torch = import_module("torch")
    neural = import_module("sysidentpy.neural_network")
    basis = import_module("sysidentpy.basis_function")
    u, y = joined(runs)
    lag, units = int(how.get("lags", 2)), int(how.get("units", 10))
    torch.set_num_threads(1)  # so small a network is slower on several
    torch.manual_seed(0)
    nn = torch.nn
    layers = (
        *(nn.Linear(2 * lag, units), nn.Tanh()),
        *(nn.Linear(units, units), nn.Tanh(), nn.Linear(units, 1)),
    )
    model = neural.NARXNN(
        net=nn.Sequential(*layers),
        ylag=lag,
        xlag=lag,
        basis_function=basis.Polynomial(degree=1),
        optim_params={"betas": (0.9, 0.999), "eps": 1e-5},
        random_state=0,
    )
    model.fit(X=ahead(u, how), y=y)
    return _recursive(model, lag, how)


def _sippy(runs: Sequence[Run], how: Settings, method: str, **orders: Any) -> Any:
    u, y = joined(runs)
    identify = import_module("sippy_unipi").system_identification
    return identify(y.T.copy(), ahead(u, how).T.copy(), method, **orders)


def _transfer(model: Any, how: Settings) -> Simulate:
    """Return what simulates transfer functions of SIPPY, one denominator for each output."""
    parts = [
        (np.asarray(own[0], dtype=float), [np.concatenate([[0.0], b]) for b in numerators])
        for own, numerators in zip(model.DENOMINATOR, model.NUMERATOR, strict=True)
    ]

    def simulate(u: Array, known: Array) -> Array:
        given, p, found = ahead(u, how), len(known), []
        for place, (a, numerators) in enumerate(parts):
            driven = sum(lfilter(b, [1.0], given[:, k]) for k, b in enumerate(numerators))
            start = lfiltic([1.0], a, known[::-1, place][: len(a) - 1])
            free, _ = lfilter([1.0], a, np.asarray(driven)[p:], zi=start)
            found.append(np.concatenate([known[:, place], free]))
        return np.column_stack(found)

    return simulate


def arx(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit SIPPY's ARX."""
    del trials
    orders = {"ARX_orders": [how["poles"], how["zeros"], 0]} if how else {}
    return _transfer(_sippy(runs, how, "ARX", **orders), how)


def armax(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit SIPPY's ARMAX."""
    del trials
    orders = {"ARMAX_orders": [how["poles"], how["zeros"], how["noise"], 0]} if how else {}
    return _transfer(_sippy(runs, how, "ARMAX", **orders), how)


def started(a: Array, c: Array, forced: Callable[[Array], Array], u: Array, known: Array) -> Array:
    """Return the state (n,) before known outputs that explains them best by least squares.

    Parameters
    ----------
    forced : callable
        From inputs to the outputs of the model that starts from rest.
    """
    rows = [c]
    for _ in range(len(known) - 1):
        rows.append(rows[-1] @ a)
    missing = (known - forced(u)).ravel()
    return np.asarray(np.linalg.lstsq(np.vstack(rows), missing, rcond=None)[0])


def _state_space(a: Array, c: Array, response: Callable[[Array, Array], Array]) -> Simulate:
    """Return what simulates a state space from where it explains the last known outputs."""

    def simulate(u: Array, known: Array) -> Array:
        first = max(0, len(known) - MOST_KNOWN)
        rest = np.zeros(len(a))
        told = u[first : len(known)]
        start = started(a, c, lambda given: response(given, rest), told, known[first:])
        return np.vstack([known[:first], response(u[first:], start)])

    return simulate


def n4sid(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit SIPPY's N4SID."""
    del trials
    model = _sippy(runs, {}, "N4SID", **how)
    process = import_module("sippy_unipi.functionsetSIM").SS_lsim_process_form
    a, b, c, d = (np.asarray(part, dtype=float) for part in (model.A, model.B, model.C, model.D))

    def response(u: Array, start: Array) -> Array:
        return np.asarray(process(a, b, c, d, u.T, start[:, np.newaxis])[1]).T

    return _state_space(a, c, response)


def moesp(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit nfoursid's state space."""
    del trials
    u, y = joined(runs)
    frame = import_module("pandas").DataFrame(np.hstack([u, y]))
    inputs = list(range(u.shape[1]))
    outputs = list(range(u.shape[1], u.shape[1] + y.shape[1]))
    blocks = {"num_block_rows": how["blocks"]} if how else {}
    library = import_module("nfoursid.nfoursid")
    identification = library.NFourSID(frame, output_columns=outputs, input_columns=inputs, **blocks)
    identification.subspace_identification()
    found = identification.system_identification(rank=how.get("order"))[0]
    space = import_module("nfoursid.state_space").StateSpace

    def response(u: Array, start: Array) -> Array:
        model = space(found.a, found.b, found.c, found.d, x_init=start[:, np.newaxis])
        return np.hstack([model.step(now[:, np.newaxis]) for now in u]).T

    return _state_space(found.a, found.c, response)


def realization(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit python-control's eigensystem realization, of Markov parameters by least squares."""
    del trials
    control = import_module("control")
    u, y = joined(runs)
    markov = np.reshape(
        control.markov(y.T, u.T, how["markov"]), (y.shape[1], u.shape[1], how["markov"])
    )
    half = (how["markov"] - 1) // 2
    model, _ = control.eigensys_realization(markov, how["order"], m=half, n=half)

    def response(u: Array, start: Array) -> Array:
        found = control.forced_response(model, inputs=u.T, initial_state=start, squeeze=False)
        return np.asarray(found.outputs).T

    return _state_space(np.asarray(model.A), np.asarray(model.C), response)


JOINED = "several recordings are joined end to end, for it takes one"
PRESENT = "`present`: inputs a sample early, for else it never sees the present one"
BY_OUTPUT = "of several outputs, a model for each, for it has one only"

LINEAR = (
    Peer(
        name="ARX",
        package="SIPPY",
        fit=arx,
        grid=grid(present=[False, True], poles=[1, 2, 3, 5], zeros=[1, 2, 4]),
        default={},
        note=f"{JOINED}; {PRESENT}; run by SciPy's `lfilter`, for it has one-step prediction only",
    ),
    Peer(
        name="ARMAX",
        package="SIPPY",
        fit=armax,
        grid=grid(noise=[1, 2], present=[False, True], poles=[1, 2, 3], zeros=[1, 2]),
        default={},
        note=f"{JOINED}; {PRESENT}; run by SciPy's `lfilter`, for it has one-step prediction only",
    ),
    Peer(
        name="N4SID",
        package="SIPPY",
        fit=n4sid,
        grid=grid(SS_f=[10, 20], SS_D_required=[False, True], SS_fixed_order=[1, 2, 3, 4, 6, 8]),
        default={},
        note=JOINED,
    ),
    Peer(
        name="N4SID",
        package="nfoursid",
        fit=moesp,
        grid=grid(blocks=[5, 10, 15], order=[1, 2, 3, 4, 5]),
        default={},
        note=JOINED,
    ),
    Peer(
        name="Markov parameters and ERA",
        package="python-control",
        fit=realization,
        grid=grid(markov=[11, 21, 31], order=[1, 2, 3, 4, 5]),
        default=None,
        note=f"{JOINED}; its order has no default",
    ),
)

NARX = (
    Peer(
        name="FROLS, polynomial NARX",
        package="sysidentpy",
        fit=each_output(polynomial),
        grid=grid(lags=[1, 2, 3, 5], degree=[1, 2, 3], present=[True, False]),
        default={},
        note=f"{JOINED}; {PRESENT}; {BY_OUTPUT}; searched by least squares, up to {MOST_TERMS} terms",
    ),
    Peer(
        name="NARXNN, network",
        package="sysidentpy",
        fit=network,
        grid=grid(units=[10], present=[True, False], lags=[1, 2, 4]),
        default={},
        note=f"{JOINED}; {PRESENT}; two layers of 10 tanh, as in its documentation",
        one_input=True,  # its lags of inputs are integers, those of several would be lists
    ),
)

"""Other libraries than networks that identify models, each called as its documentation does.

None is in this project's environment: they are imported when they are used, and typed as anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import combinations_with_replacement, product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfiltic

Array = NDArray[np.float64]

Run = tuple[Array, Array]
"""Inputs (n, k) and outputs (n, m) of a recording, of zero mean and unit variance in training."""

Simulate = Callable[[Array, Array], Array]
"""From inputs (n, k) and the first p measured outputs (p, m) to outputs (n, m), free from p on."""

Settings = dict[str, Any]

MOST_KNOWN = 200
"""Known outputs, the last ones, that the state of a linear model is found from."""

MOST_TERMS = 30
"""Terms that FROLS may select where its settings are searched for."""

MOST_LIFTED = 300
"""Monomials that a Koopman model may have."""


@dataclass(frozen=True)
class Trial:
    """A recording to run free on, whose first `known` outputs a model is given."""

    inputs: Array
    outputs: Array
    known: int

    def run(self, simulate: Simulate) -> Array:
        """Return the outputs (n, m) of a model, those known as they were measured."""
        known = self.outputs[: self.known]
        return np.vstack([known, np.asarray(simulate(self.inputs, known))[self.known :]])


@dataclass(frozen=True)
class Peer:
    """A way to identify a model, and the settings to search among, cheapest first.

    From training runs, settings (none: the library's defaults), and trials to stop a training early by,
    `fit` makes a model. `defaults` are those of a library that has some. With `seeds`, a model is fitted
    by so many at the settings found, and the median taken; one that `stops_early` does so on what is
    held back. `sets` are those that it is for, where it is not for all; `seconds` the most for one fit.
    """

    name: str
    fit: Callable[[Sequence[Run], Settings, Sequence[Trial]], Simulate]
    grid: Sequence[Settings]
    seconds: float = 120.0
    seeds: int = 0
    stops_early: bool = False
    defaults: bool = False
    sets: tuple[str, ...] = ()


def grid(**choices: Sequence[Any]) -> list[Settings]:
    """Return all combinations of settings, the last varying fastest."""
    return [dict(zip(choices, values, strict=True)) for values in product(*choices.values())]


def joined(runs: Sequence[Run]) -> Run:
    """Return runs end to end, for libraries that take one."""
    return np.vstack([u for u, _ in runs]), np.vstack([y for _, y in runs])


def ahead(u: Array, how: Settings) -> Array:
    """Return inputs a sample early, if settings ask: a model with delay then sees the present."""
    return np.vstack([u[1:], u[-1:]]) if how.get("present") else u


def frols(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit sysidentpy's polynomial NARX, its terms selected by FROLS, a model for each output."""
    del trials
    structure = import_module("sysidentpy.model_structure_selection")
    basis = import_module("sysidentpy.basis_function")
    estimators = import_module("sysidentpy.parameter_estimation")
    u, y = joined(runs)
    inputs, lag, degree = u.shape[1], int(how.get("lags", 2)), int(how.get("degree", 2))
    candidates = math.comb(lag * (1 + inputs) + degree, degree)
    models = []
    for output in y.T:
        model = structure.FROLS(
            ylag=lag,
            xlag=lag if inputs == 1 else [list(range(1, lag + 1)) for _ in range(inputs)],
            basis_function=basis.Polynomial(degree=degree),
            n_info_values=min(MOST_TERMS if how else 15, candidates),
            **({"estimator": estimators.LeastSquares()} if how else {}),
        )
        model.fit(X=ahead(u, how), y=output[:, np.newaxis].copy())
        models.append(model)

    def simulate(u: Array, known: Array) -> Array:
        first = len(known) - lag
        given = ahead(u, how)[first:]
        found = [
            np.reshape(model.predict(X=given, y=known[first:, [place]]), (-1, 1))
            for place, model in enumerate(models)
        ]
        return np.vstack([known[:first], np.hstack(found)])

    return simulate


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


def n4sid(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit SIPPY's N4SID; its state is that which explains the last known outputs best."""
    del trials
    model = _sippy(runs, {}, "N4SID", **how)
    process = import_module("sippy_unipi.functionsetSIM").SS_lsim_process_form
    a, b, c, d = (np.asarray(part, dtype=float) for part in (model.A, model.B, model.C, model.D))

    def response(u: Array, start: Array) -> Array:
        return np.asarray(process(a, b, c, d, u.T, start[:, np.newaxis])[1]).T

    def simulate(u: Array, known: Array) -> Array:
        first = max(0, len(known) - MOST_KNOWN)
        rows = [c]
        for _ in range(len(known) - first - 1):
            rows.append(rows[-1] @ a)
        missing = known[first:] - response(u[first : len(known)], np.zeros(len(a)))
        start = np.linalg.lstsq(np.vstack(rows), missing.ravel(), rcond=None)[0]
        return np.vstack([known[:first], response(u[first:], start)])

    return simulate


def lifted(values: Array, degree: int) -> Array:
    """Return all monomials (n, k) of columns up to a degree, the constant first."""
    columns = [np.ones(len(values))]
    for power in range(1, degree + 1):
        for chosen in combinations_with_replacement(values.T, power):
            columns.append(np.prod(chosen, axis=0))
    return np.column_stack(columns)


def koopman(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit PyDMD's DMDc to monomials of delayed outputs and inputs: EDMD with control.

    What is lifted evolves linearly, driven by the powers of each input; runs are joined.
    """
    del trials
    delays, degree = how["delays"], how["degree"]

    def states(u: Array, y: Array) -> Array:
        """Return what is lifted of the samples from `delays` on."""
        n = len(y)
        past = [y[lag : n - delays + lag] for lag in range(delays, -1, -1)]
        past += [u[lag : n - delays + lag] for lag in range(delays - 1, -1, -1)]
        count = math.comb(sum(one.shape[1] for one in past) + degree, degree)
        if count > MOST_LIFTED:
            raise ValueError(f"{count} monomials are more than {MOST_LIFTED}")
        return lifted(np.hstack(past), degree)

    def driving(u: Array) -> Array:
        return np.hstack([u**power for power in range(1, degree + 1)])

    u, y = joined(runs)
    given = ahead(u, how)
    model = import_module("pydmd").DMDc(svd_rank=how["rank"], svd_rank_omega=how["rank"])
    model.fit(states(given, y).T, driving(given)[delays:-1].T)
    basis = np.real(model.basis)
    a = basis @ np.real(model.operator.as_numpy_array) @ basis.T
    b = np.real(model.B)

    def simulate(u: Array, known: Array) -> Array:
        given, first, m = ahead(u, how), len(known), known.shape[1]
        state = states(given[:first], known)[-1]
        found = []
        for push in driving(given)[first - 1 : -1] @ b.T:
            state = a @ state + push
            found.append(state[1 : 1 + m])
        return np.vstack([known, found])

    return simulate


MUSCLE = """<mujoco>
  <option timestep="1" gravity="0 0 0"/>
  <worldbody><body><joint name="end" type="slide"/>
    <inertial pos="0 0 0" mass="1e12" diaginertia="1 1 1"/></body></worldbody>
  <actuator><general name="muscle" joint="end" dyntype="filterexact" dynprm="1"
    gaintype="affine" gainprm="1 0 0" biastype="affine"
    forcelimited="true" forcerange="-9 99"/></actuator>
  <sensor><actuatorfrc name="force" actuator="muscle"/></sensor>
</mujoco>"""
"""A muscle that is held: an actuator whose gain and bias are linear in length, behind a lag."""


def mujoco_sysid(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit such a muscle with MuJoCo's own `sysid`: gain, bias, lag in samples, and least force.

    The input is the length, held, and the pressure.
    """
    del how, trials
    mujoco, sysid = import_module("mujoco"), import_module("mujoco.sysid")
    spec = mujoco.MjSpec.from_string(MUSCLE)
    model = spec.compile()

    def setter(table: str, place: int) -> Callable[[Any, Any], None]:
        def put(spec: Any, parameter: Any) -> None:
            values = getattr(spec.actuator("muscle"), table)
            values[place] = float(parameter.value[0])

        return put

    parameters = sysid.ParameterDict()
    for name, table, place, nominal, low, high in (
        ("gain", "gainprm", 0, 1.0, -10.0, 10.0),
        ("gain_length", "gainprm", 1, 0.1, -10.0, 10.0),
        ("bias", "biasprm", 0, 0.1, -10.0, 10.0),
        ("bias_length", "biasprm", 1, 0.1, -10.0, 10.0),
        ("lag", "dynprm", 0, 2.0, 0.05, 50.0),
        ("least", "forcerange", 0, -2.0, -9.0, 1.0),
    ):
        put = setter(table, place)
        parameters.add(sysid.Parameter(name, nominal, low, high, modifier=put))

    def start(u: Array) -> Any:
        return sysid.create_initial_state(model, u[0, :1], np.zeros(1), u[0, 1:])

    def control(u: Array) -> Any:
        return sysid.TimeSeries.from_control_names(np.arange(len(u)), u[:, 1:], model)

    sequences = sysid.ModelSequences(
        name="muscle",
        spec=spec,
        sequence_name=[str(place) for place in range(len(runs))],
        initial_state=[start(u) for u, _ in runs],
        control=[control(u) for u, _ in runs],
        sensordata=[sysid.TimeSeries.from_names(np.arange(len(y)), y, model) for _, y in runs],
    )
    residual = sysid.build_residual_fn(models_sequences=[sequences])
    found, _ = sysid.optimize(parameters, residual, verbose=False)
    fitted = sysid.apply_param_modifiers_spec(found, spec).compile()

    def simulate(u: Array, known: Array) -> Array:
        del known
        data = mujoco.MjData(fitted)
        data.qpos[:], data.act[:] = u[0, 0], u[0, 1]
        forces = []
        for _, pressure in u:
            data.ctrl[:] = pressure
            mujoco.mj_forward(fitted, data)
            forces.append(data.sensordata.copy())
            mujoco.mj_step(fitted, data)
        return np.array(forces)

    return simulate


LIBRARIES = (
    Peer(
        "SIPPY ARX",
        arx,
        grid(present=[False, True], poles=[1, 2, 3, 5], zeros=[1, 2, 4]),
        defaults=True,
    ),
    Peer(
        "SIPPY N4SID",
        n4sid,
        grid(SS_f=[10, 20], SS_D_required=[False, True], SS_fixed_order=[1, 2, 3, 4, 6, 8]),
        defaults=True,
    ),
    Peer(
        "sysidentpy FROLS",
        frols,
        grid(lags=[1, 2, 3, 5], degree=[1, 2, 3], present=[True, False]),
        defaults=True,
    ),
    Peer(
        "PyDMD Koopman",
        koopman,
        grid(degree=[1, 2, 3], delays=[1, 2, 4, 8, 16], present=[True, False], rank=[-1, 0]),
    ),
    Peer("MuJoCo sysid", mujoco_sysid, [{}], seconds=300.0, sets=("festo_isometric_20mm",)),
)

"""Other libraries that identify models from recordings, each called as its documentation does.

None is in this project's environment: they are imported when they are used, and typed as anything.
"""

from __future__ import annotations

import math
import time
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

MOST_KNOWN = 200
"""Known outputs, the last ones, that the state of a linear model is found from."""

MOST_TERMS = 30
"""Terms that FROLS may select where its settings are searched for."""

UNITS, RATE, CHUNK, EPOCHS, PATIENCE, SECONDS = 32, 5e-3, 100, 400, 60, 25.0
"""Of the network: units, Adam's rate, samples after which gradients are cut, most epochs, epochs without
a lower error on the trials after which training stops, and most seconds of processor time."""


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
    `fit` makes a model. With `seconds`, for one fit, the grid is not searched: the median is taken.
    `sets` are those that it is for, where it is not for all.
    """

    name: str
    fit: Callable[[Sequence[Run], Settings, Sequence[Trial]], Simulate]
    grid: Sequence[Settings]
    seconds: float = 0.0
    stops_early: bool = False
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


def gru(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Train torch's GRU on runs at once; return it with the weights that do best on the trials.

    It is trained free-running, by truncated back-propagation through time.
    """
    torch = import_module("torch")
    torch.set_num_threads(1)  # so small a network is slower on several
    torch.manual_seed(how["seed"])
    inputs, outputs = runs[0][0].shape[1], runs[0][1].shape[1]
    nn = torch.nn
    parts = nn.ModuleDict(
        {
            "start": nn.Linear(inputs + outputs, UNITS),
            "memory": nn.GRU(inputs, UNITS, batch_first=True),
            "output": nn.Linear(UNITS, outputs),
        }
    )
    optimiser = torch.optim.Adam(parts.parameters(), lr=RATE)

    def tensor(values: Array) -> Any:
        return torch.as_tensor(np.ascontiguousarray(values), dtype=torch.float32)

    def simulate(u: Array, known: Array) -> Array:
        with torch.no_grad():
            begun = torch.tanh(parts["start"](tensor(np.concatenate([u[0], known[0]]))))
            states, _ = parts["memory"](tensor(u)[None], begun[None, None])
            return np.asarray(parts["output"](states)[0].numpy(), dtype=float)

    def batch(columns: Sequence[Array]) -> Any:
        padded = [np.pad(one, ((0, longest - len(one)), (0, 0))) for one in columns]
        return torch.stack([tensor(one) for one in padded])

    longest = max(len(u) for u, _ in runs)
    given, wanted = batch([u for u, _ in runs]), batch([y for _, y in runs])
    counted = batch([np.ones((len(u), 1)) for u, _ in runs])
    best, best_error, best_epoch = parts.state_dict(), math.inf, 0
    ends = time.process_time() + SECONDS
    for epoch in range(EPOCHS):
        state = torch.tanh(parts["start"](torch.cat([given[:, 0], wanted[:, 0]], dim=1)))[None]
        for first in range(0, longest, CHUNK):
            piece = slice(first, first + CHUNK)
            states, state = parts["memory"](given[:, piece], state)
            missed = (parts["output"](states) - wanted[:, piece]) * counted[:, piece]
            loss = missed.square().sum() / counted[:, piece].sum().clamp(min=1.0)
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(parts.parameters(), 1.0)
            optimiser.step()
            state = state.detach()
        missing = [(one.run(simulate) - one.outputs)[one.known :] for one in trials]
        error = sum(float(np.sum(one**2)) for one in missing)
        if error < best_error:
            best = {name: value.clone() for name, value in parts.state_dict().items()}
            best_error, best_epoch = error, epoch
        if epoch - best_epoch > PATIENCE or time.process_time() > ends:
            break
    parts.load_state_dict(best)
    return simulate


def jax_rnn(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit jax-sysid's recurrent network as its authors' script for the Bouc-Wen benchmark does.

    Three states and 16 hidden units each for state and output, beside a linear model that starts it;
    200 epochs of Adam, then L-BFGS. The test's start is learned from its known outputs alone.
    """
    del trials
    jax, models = import_module("jax"), import_module("jax_sysid.models")
    jax.config.update("jax_enable_x64", True)
    gelu, states, hidden = jax.nn.gelu, 3, 16
    inputs, outputs = runs[0][0].shape[1], runs[0][1].shape[1]
    u, y = [u for u, _ in runs], [y for _, y in runs]

    def step(x: Any, u: Any, params: Any) -> Any:
        p = params
        return p[0] @ x + p[1] @ u + p[5] @ gelu(p[3] @ x + p[4] @ u + p[6]) + p[7]

    def output(x: Any, u: Any, params: Any) -> Any:
        del u
        p = params
        return p[2] @ x + p[9] @ gelu(p[8] @ x + p[10]) + p[11]

    linear = models.LinearModel(states, outputs, inputs, feedthrough=False)
    linear.loss(rho_x0=1e-3, rho_th=1e-2)
    linear.optimization(adam_epochs=0, lbfgs_epochs=1000, iprint=-1)
    linear.fit(y, u)
    rng = np.random.default_rng(how["seed"])
    shapes: list[Any] = [(hidden, states), (hidden, inputs), (states, hidden), hidden, states]
    shapes += [(hidden, states), (outputs, hidden), hidden, outputs]
    small = [
        0.1 * rng.standard_normal(n) if isinstance(n, tuple) else np.zeros((n,)) for n in shapes
    ]
    model = models.Model(states, outputs, inputs, state_fcn=step, output_fcn=output)
    model.init([*linear.params, *small])
    model.loss(rho_x0=1e-8, rho_th=1e-12)
    model.optimization(adam_epochs=200, lbfgs_epochs=how["epochs"], iprint=-1)
    model.fit(y, u)

    def simulate(u: Array, known: Array) -> Array:
        start = model.learn_x0(u[: len(known)], known, RTS_epochs=10, verbosity=False)
        return np.asarray(model.predict(start, u)[0])

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


PEERS = (
    Peer("SIPPY ARX", arx, grid(present=[False, True], poles=[1, 2, 3, 5], zeros=[1, 2, 4])),
    Peer(
        "SIPPY N4SID",
        n4sid,
        grid(SS_f=[10, 20], SS_D_required=[False, True], SS_fixed_order=[1, 2, 3, 4, 6, 8]),
    ),
    Peer(
        "sysidentpy FROLS",
        frols,
        grid(lags=[1, 2, 3, 5], degree=[1, 2, 3], present=[True, False]),
    ),
    Peer(f"torch GRU {UNITS}", gru, grid(seed=[0, 1, 2]), seconds=4 * SECONDS, stops_early=True),
    Peer(
        "jax-sysid RNN",
        jax_rnn,
        grid(seed=[3], epochs=[500]),
        seconds=1200.0,
        sets=("bouc_wen_benchmark",),
    ),
    Peer(
        "MuJoCo sysid", mujoco_sysid, grid(seed=[0]), seconds=300.0, sets=("festo_isometric_20mm",)
    ),
)

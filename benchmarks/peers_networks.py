"""Networks that identify models from recordings: torch, reservoirpy, diffrax, jax-sysid.

None is in this project's environment: they are imported when they are used, and typed as anything.
Settings hold a `seed`, and the `seconds` of processor time that a training may take.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from tempfile import gettempdir
from typing import Any

import numpy as np

from peers_libraries import Array, Peer, Run, Settings, Simulate, Trial, grid

CHUNK, EPOCHS, PATIENCE = 100, 400, 60
"""Samples after which gradients are cut, most epochs, and epochs without a lower error on the trials
after which training stops."""

SETTLING = 200
"""Samples for which the first input is held before an echo-state network's first sample."""

ELEMENTS, UNITS, FASTEST, STEPS = 4, 16, 4.0, 2
"""Of the neural ODE: friction elements for each input or output, units, highest rate, steps a sample."""


def pieces(longest: int) -> Iterator[slice]:
    """Yield the samples between which gradients are cut."""
    return (slice(first, first + CHUNK) for first in range(0, longest, CHUNK))


def padded(columns: Sequence[Array]) -> Array:
    """Return runs of any length as (run, n, k), zero after their end, n a multiple of `CHUNK`."""
    longest = CHUNK * math.ceil(max(len(one) for one in columns) / CHUNK)
    return np.stack([np.pad(one, ((0, longest - len(one)), (0, 0))) for one in columns])


def trained(
    epoch: Callable[[Callable[[], bool]], Any],
    simulate: Simulate,
    trials: Sequence[Trial],
    seconds: float,
    best: Any,
) -> Any:
    """Return the weights of the epoch after which the free runs of the trials are best.

    `epoch` trains and returns a copy of the weights; it ends early where what it is given says so.
    """
    ends = time.process_time() + seconds

    def late() -> bool:
        return time.process_time() > ends

    best_error, best_epoch = math.inf, 0
    for number in range(EPOCHS):
        weights = epoch(late)
        missing = [(one.run(simulate) - one.outputs)[one.known :] for one in trials]
        error = sum(float(np.sum(one**2)) for one in missing)
        if error < best_error:
            best, best_error, best_epoch = weights, error, number
        if number - best_epoch > PATIENCE or late():
            break
    return best


def torch_network(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Train torch's GRU or LSTM, or a layer (cell none), on runs at once, free-running.

    With `plays`, play operators of learned directions and thresholds stand before it. As clamps in
    series are a clamp, a run of them takes log2(n) steps. The start is a function of the first sample.
    """
    torch = import_module("torch")
    torch.set_num_threads(1)  # so small a network is slower on several
    torch.manual_seed(how["seed"])
    nn, softplus = torch.nn, torch.nn.functional.softplus
    inputs, outputs = runs[0][0].shape[1], runs[0][1].shape[1]
    cell, units, plays = how["cell"], how["units"], how.get("plays", 0)
    kept = {"GRU": units, "LSTM": 2 * units, "none": 0}[cell]
    parts = nn.ModuleDict(
        {
            "start": nn.Linear(inputs + outputs, kept + plays),
            "memory": (
                getattr(nn, cell)(inputs + plays, units, batch_first=True)
                if kept
                else nn.Sequential(nn.Linear(inputs + plays, units), nn.Tanh())
            ),
            "output": nn.Linear(units, outputs),
        }
    )
    if plays:
        parts["direction"] = nn.Linear(inputs, plays, bias=False)
        parts["threshold"] = nn.Linear(1, plays, bias=False)
        parts["passed"] = nn.Linear(inputs + plays, outputs, bias=False)
        with torch.no_grad():
            parts["threshold"].weight[:, 0] = torch.linspace(-4.0, 1.0, plays)
    optimiser = torch.optim.Adam(parts.parameters(), lr=how["rate"])

    def tensor(values: Array) -> Any:
        return torch.as_tensor(np.ascontiguousarray(values), dtype=torch.float32)

    def played(u: Any, start: Any) -> Any:
        """Return play operators (run, n, plays) of inputs."""
        wide = softplus(parts["threshold"].weight[:, 0])
        middle = parts["direction"](u)
        low, high, step = middle - wide, middle + wide, 1
        while step < u.shape[1]:
            least, most = low[:, step:], high[:, step:]
            before_low = torch.minimum(torch.maximum(low[:, :-step], least), most)
            before_high = torch.minimum(torch.maximum(high[:, :-step], least), most)
            low = torch.cat([low[:, :step], before_low], dim=1)
            high = torch.cat([high[:, :step], before_high], dim=1)
            step *= 2
        return torch.minimum(torch.maximum(start[:, None], low), high)

    def begun(first: Any) -> tuple[Any, Any]:
        state = torch.tanh(parts["start"](first))
        return state[:, :kept], state[:, kept:]

    def forward(u: Any, state: tuple[Any, Any]) -> tuple[Any, tuple[Any, Any]]:
        memory, play = state
        if plays:
            z = played(u, play)
            u, play = torch.cat([u, z], dim=2), z[:, -1]
        if cell == "LSTM":
            pair = [part[None].contiguous() for part in memory.split(units, dim=1)]
            found, (h, c) = parts["memory"](u, tuple(pair))
            memory = torch.cat([h[0], c[0]], dim=1)
        elif kept:
            found, h = parts["memory"](u, memory[None].contiguous())
            memory = h[0]
        else:
            found = parts["memory"](u)
        y = parts["output"](found)
        return (y + parts["passed"](u) if plays else y), (memory, play)

    def simulate(u: Array, known: Array) -> Array:
        with torch.no_grad():
            first = tensor(np.concatenate([u[0], known[0]]))[None]
            found, _ = forward(tensor(u)[None], begun(first))
            return np.asarray(found[0].numpy(), dtype=float)

    given, wanted = tensor(padded([u for u, _ in runs])), tensor(padded([y for _, y in runs]))
    counted = tensor(padded([np.ones((len(u), 1)) for u, _ in runs]))

    def epoch(late: Callable[[], bool]) -> Any:
        state = begun(torch.cat([given[:, 0], wanted[:, 0]], dim=1))
        for piece in pieces(given.shape[1]):
            found, (memory, play) = forward(given[:, piece], state)
            missed = (found - wanted[:, piece]) * counted[:, piece]
            loss = missed.square().sum() / counted[:, piece].sum().clamp(min=1.0)
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(parts.parameters(), 1.0)
            optimiser.step()
            state = memory.detach(), play.detach()
            if late():
                break
        return {name: value.clone() for name, value in parts.state_dict().items()}

    weights = trained(epoch, simulate, trials, how["seconds"], parts.state_dict())
    parts.load_state_dict(weights)
    return simulate


def echo_state(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Fit reservoirpy's echo-state network: its readout, by ridge regression, sees the inputs too."""
    del trials
    nodes = import_module("reservoirpy.nodes")
    own = {name: how[name] for name in ("units", "lr", "sr", "input_scaling", "seed")}
    source, reservoir = nodes.Input(), nodes.Reservoir(input_connectivity=1.0, **own)
    model = [source >> reservoir, source] >> nodes.Ridge(ridge=how["ridge"])

    def held(values: Array) -> Array:
        return np.vstack([np.repeat(values[:1], SETTLING, axis=0), values])

    model.fit([held(u) for u, _ in runs], [held(y) for _, y in runs], warmup=SETTLING)

    def simulate(u: Array, known: Array) -> Array:
        del known
        model.reset()
        return np.asarray(model.run(held(u)))[SETTLING:]

    return simulate


def neural_ode(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Train a force balance with a small network in it, integrated by diffrax.

    Inputs pass a first-order lag: p' = a (u - p). Friction is Dahl's, s' = |w'|/d (sign(w') - s),
    limited to the rate that steps of half a sample integrate. With `mass`, w is the output, and
    y'' = B p - K y - c y' - F s + net(p, y, y', s); without, w is p, and y = B p + D u + net(p, u, s).
    """
    jax, jnp = import_module("jax"), import_module("jax.numpy")
    diffrax, optax = import_module("diffrax"), import_module("optax")
    jax.config.update("jax_compilation_cache_dir", f"{gettempdir()}/peers-jax")  # for all fits
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    positive, mass = jax.nn.softplus, how["mass"]
    k, m = runs[0][0].shape[1], runs[0][1].shape[1]
    elements = ELEMENTS * (m if mass else k)
    seen = k + elements + (2 * m if mass else k)
    rng = np.random.default_rng(how["seed"])
    params = {
        "lag": np.ones(k),
        "width": np.tile(np.linspace(-3.0, 1.0, ELEMENTS), m if mass else k),
        "push": rng.normal(0.0, 0.1, (m, k)),
        "passed": rng.normal(0.0, 0.1, (m, k)),
        "stiffness": np.full(m, -2.0),
        "damping": np.full(m, -1.0),
        "friction": np.full((m, elements), -3.0),
        "first": rng.normal(0.0, seen**-0.5, (UNITS, seen)),
        "bias": rng.normal(0.0, 0.5, UNITS),
        "last": rng.normal(0.0, 0.01, (m, UNITS)),
        "level": np.zeros(m),
    }
    params = {name: jnp.asarray(value, jnp.float32) for name, value in params.items()}

    def net(params: Any, *parts: Any) -> Any:
        hidden = jnp.tanh(params["first"] @ jnp.concatenate(parts) + params["bias"])
        return params["last"] @ hidden + params["level"]

    def field(t: Any, state: Any, given: Any) -> Any:
        params, path = given
        p, s, y, v = jnp.split(state, [k, k + elements, k + elements + m])
        lagged = FASTEST * jax.nn.sigmoid(params["lag"]) * (path.evaluate(t) - p)
        moved = jnp.repeat(v if mass else lagged, ELEMENTS) / positive(params["width"])
        limit = 1 + jnp.abs(moved) / FASTEST
        rubbed = (moved - jnp.abs(moved) * s) / limit
        if not mass:
            return jnp.concatenate([lagged, rubbed, jnp.zeros(2 * m)])
        force = params["push"] @ p - positive(params["stiffness"]) * y
        force -= positive(params["damping"]) * v + positive(params["friction"]) @ s
        force += net(params, p, s, y, v)
        return jnp.concatenate([lagged, rubbed, v, force])

    times = jnp.arange(CHUNK + 1.0)

    def advance(params: Any, state: Any, u: Any) -> tuple[Any, Any]:
        """Return the outputs and the last state of a piece, whose inputs begin a sample before it."""
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Bosh3(),
            0.0,
            float(CHUNK),
            1 / STEPS,
            state,
            args=(params, diffrax.LinearInterpolation(times, u)),
            saveat=diffrax.SaveAt(ts=times[1:]),
            max_steps=2 * STEPS * CHUNK,
            throw=False,
        )
        states = solution.ys
        p, s, y, _ = jnp.split(states, [k, k + elements, k + elements + m], axis=1)
        if not mass:
            y = p @ params["push"].T + u[1:] @ params["passed"].T
            y += jax.vmap(partial(net, params))(p, s, u[1:])
        return y, states[-1]

    optimiser = optax.chain(optax.clip_by_global_norm(1.0), optax.adam(how["rate"]))

    def loss(params: Any, states: Any, u: Any, y: Any, counted: Any) -> tuple[Any, Any]:
        found, states = jax.vmap(partial(advance, params))(states, u)
        return jnp.sum(((found - y) * counted) ** 2) / jnp.maximum(jnp.sum(counted), 1.0), states

    def update(params: Any, held: Any, states: Any, u: Any, y: Any, counted: Any) -> Any:
        slopes, states = jax.grad(loss, has_aux=True)(params, states, u, y, counted)
        changes, held = optimiser.update(slopes, held)
        return optax.apply_updates(params, changes), held, states

    def begun(u: Array, y: Array) -> Array:
        moved = (y[1] - y[0]) if mass else np.zeros(m)
        return np.concatenate([u[0], np.zeros(elements), y[0], moved]).astype(np.float32)

    def earlier(u: Array) -> Array:
        """Return inputs (run, n + 1, k), the first sample twice."""
        return np.concatenate([u[:, :1], u], axis=1).astype(np.float32)

    stepped, updated = jax.jit(advance), jax.jit(update)
    current = params

    def simulate(u: Array, known: Array) -> Array:
        given, state, found = earlier(padded([u]))[0], begun(u, known), []
        for piece in pieces(len(u)):
            y, state = stepped(current, state, given[piece.start : piece.stop + 1])
            found.append(np.asarray(y, dtype=float))
        return np.vstack(found)[: len(u)]

    given, wanted = earlier(padded([u for u, _ in runs])), padded([y for _, y in runs])
    counted = padded([np.ones((len(u), 1)) for u, _ in runs])
    held = optimiser.init(params)

    def epoch(late: Callable[[], bool]) -> Any:
        nonlocal current, held
        states = np.stack([begun(u, y) for u, y in runs])
        for piece in pieces(wanted.shape[1]):
            inputs = given[:, piece.start : piece.stop + 1]
            current, held, states = updated(
                current, held, states, inputs, wanted[:, piece], counted[:, piece]
            )
            if late():
                break
        return current

    current = trained(epoch, simulate, trials, how["seconds"], params)
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


NETWORKS = (
    Peer(
        "torch GRU 32",
        torch_network,
        grid(cell=["GRU"], units=[32], rate=[5e-3]),
        seeds=3,
        stops_early=True,
    ),
    Peer(
        "torch LSTM",
        torch_network,
        grid(cell=["LSTM"], units=[16, 64], rate=[1e-2, 2e-3]),
        seeds=3,
        stops_early=True,
    ),
    Peer(
        "torch plays",
        torch_network,
        grid(cell=["none", "GRU"], units=[32], plays=[32], rate=[1e-2, 2e-3]),
        seeds=3,
        stops_early=True,
    ),
    Peer(
        "reservoirpy ESN",
        echo_state,
        grid(
            units=[100, 300],
            input_scaling=[0.3, 1.0],
            lr=[1.0, 0.3, 0.1],
            sr=[0.5, 0.9],
            ridge=[1e-6, 1e-2],
        ),
        seeds=3,
    ),
    Peer(
        "diffrax neural ODE",
        neural_ode,
        grid(mass=[False, True], rate=[1e-2]),
        seeds=3,
        stops_early=True,
    ),
    Peer(
        "jax-sysid RNN",
        jax_rnn,
        grid(seed=[3], epochs=[500]),
        seconds=1200.0,
        sets=("bouc_wen_benchmark",),
    ),
)

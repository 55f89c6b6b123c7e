"""A gated recurrent unit of torch, trained free-running by truncated back-propagation through time."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from peers_libraries import Array, Peer, Run, Settings, Simulate, Trial, grid

UNITS = 32
RATE = 5e-3
CHUNK = 100
"""Samples after which gradients are cut, states carried on."""

EPOCHS = 400
PATIENCE = 60
"""Epochs without a lower error on the trials after which training stops."""

SECONDS = 25.0
"""Most that a training takes."""

SEEDS = (0, 1, 2)


def gru(runs: Sequence[Run], how: Settings, trials: Sequence[Trial]) -> Simulate:
    """Train a network on runs at once; keep the weights of the least free-running error on trials."""
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

    longest = max(len(u) for u, _ in runs)
    given, wanted, counted = (
        torch.stack([tensor(_padded(part, longest)) for part in column])
        for column in (
            [u for u, _ in runs],
            [y for _, y in runs],
            [np.ones((len(u), 1)) for u, _ in runs],
        )
    )
    best, best_error, best_epoch = parts.state_dict(), math.inf, 0
    ends = time.perf_counter() + SECONDS
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
        error = sum(float(np.sum(_missed(trial, simulate) ** 2)) for trial in trials)
        if error < best_error:
            best = {name: value.clone() for name, value in parts.state_dict().items()}
            best_error, best_epoch = error, epoch
        if epoch - best_epoch > PATIENCE or time.perf_counter() > ends:
            break
    parts.load_state_dict(best)
    return simulate


def _padded(values: Array, length: int) -> Array:
    return np.pad(values, ((0, length - len(values)), (0, 0)))


def _missed(trial: Trial, simulate: Simulate) -> Array:
    return (trial.run(simulate) - trial.outputs)[trial.known :]


GRU = Peer(
    name=f"GRU, {UNITS} units",
    package="torch",
    fit=gru,
    grid=grid(seed=SEEDS),
    default=None,
    note=(
        f"Adam at {RATE:g}, gradients cut after {CHUNK} samples, at most {EPOCHS} epochs and "
        f"{SECONDS:.0f} s; stopped early on the quarter held back, to which it is not fitted; its first "
        f"state a layer's of the first measured sample; the median of {len(SEEDS)} seeds"
    ),
)

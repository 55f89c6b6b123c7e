"""Blocks and compositions to export, and paths of inputs over their ranges."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben import GPI, Block, Channel, ModelError, ModelWarning, Series
from mckibben.blocks.adaptive.adaptive import Adaptive
from mckibben.blocks.adaptive.adaptive_series import AdaptiveSeries
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork
from mckibben.blocks.coupled.recurrent_fuzzy_network import RecurrentFuzzyNetwork
from mckibben.blocks.laws.examples import examples
from mckibben.blocks.laws.trial import input_limits, wander
from mckibben.registry import load, names
from tests.export.building import SAMPLE_TIME

Array = NDArray[np.float64]


def example(kind: str) -> Any:
    return load("blocks", kind).example()


def channels(stem: str, unit: str) -> tuple[Channel, ...]:
    return tuple(Channel(f"{stem}_{k}", unit) for k in range(1, 4))


def sdchm() -> Block:
    """Return hysteresis of three muscles, coupling, and a network scheduled by an extensor."""
    pressures, own = channels("pressure", "bar"), channels("displacement_free", "mm")
    coupled, given = channels("displacement_coupled", "mm"), channels("displacement", "mm")
    muscles = [
        replace(example(kind), input=pressure, output=free)
        for kind, pressure, free in zip(("pi", "gpi", "eupi"), pressures, own, strict=True)
    ]
    gains = ((1.0, 0.1, 0.05), (0.08, 1.0, 0.1), (0.02, 0.12, 1.0))
    centres, widths, n = (0.0, 20.0), (15.0, 15.0), 3
    consequents = [
        1.0 + 0.1 * rule / 16 if j == i else 0.05 * (i - 1)
        for rule in range(16)
        for j in range(n)
        for i in range(n + 1)
    ]
    network = FuzzyNetwork(
        (centres,) * n + ((0.0, 2.5),),
        (widths,) * n + ((1.0, 1.2),),
        tuple(consequents),
        coupled,
        given,
        (Channel("pressure_extensor", "bar"),),
        False,
        ((-40.0, 60.0),) * n,
    )
    return Series((load("blocks", "per-channel")(muscles), Coupling(gains, own, coupled), network))


def joint() -> Block:
    """Return two muscles in balance that move one coordinate."""
    balance = example("balance")
    across = Coupling(((0.5,), (-0.5,)), balance.driven, (Channel("angle", "mm"),))
    return Series((balance.inverse(), across))


def mpi_narmax() -> Block:
    """Return a Prandtl-Ishlinskii model and a recurrent network behind it, under a load."""
    network = RecurrentFuzzyNetwork.example()
    return Series((replace(example("pi"), output=network.driven[0]), network))


def virgin(kind: str) -> Any:
    return replace(example(kind), initial="virgin")


def feedforward(initial: Any) -> Block:
    """Return a force feedforward whose friction starts from a memory of its own."""
    block = example("force-feedforward")
    return replace(block, friction=replace(block.friction, initial=initial))


def envelopes(kind: str) -> Any:
    rising, falling = load("envelopes", kind).examples()
    return replace(GPI.example(), rising=rising, falling=falling)


HEAVY = replace(example("balance"), mass=(0.01, 0.02), pushes=(), bladders=())
SLACK = replace(example("balance"), pushes=(8.0, 2.0))

MODELS: dict[str, Block] = {
    **examples(),
    "SDCHM": sdchm(),
    "SDIHC": sdchm().inverse(),
    "MPI-NARMAX": mpi_narmax(),
    "heavy muscles": HEAVY,
    "heavy muscles inverse": HEAVY.inverse(),
    "slack muscles": SLACK,
    "slack muscles inverse": SLACK.inverse(),
    "joint": joint(),
    "joint inverse": joint().inverse(),
    "pi from a given memory": replace(example("pi"), initial=(0.1, 0.2, 0.3, 0.4)),
    **{
        f"virgin {kind}": virgin(kind)
        for kind in (
            *("air", "pi", "gpi", "preisach", "duhem"),
            *("krasnoselskii-pokrovskii", "maxwell-slip", "narx-network"),
        )
    },
    **{
        f"virgin {kind} inverse": virgin(kind).inverse()
        for kind in ("air", "pi", "gpi", "preisach", "duhem", "bouc-wen", "eupi")
    },
    "force after virgin friction": feedforward("virgin"),
    "force after known friction": feedforward((0.5, -0.2, 0.1, 2.0)),
    **{f"gpi {kind}": envelopes(kind) for kind in names("envelopes")},
    **{f"gpi {kind} inverse": envelopes(kind).inverse() for kind in names("envelopes")},
}
"""Examples of all kinds and of their inverses by title, compositions, and other starts."""


def path_for(block: Block, seed: int, n: int) -> Array:
    """Return inputs with minor loops and holds over the block's range, shape (n, n_inputs)."""
    rng = np.random.default_rng(seed)
    pace = 200 if block.rate_dependent else 12
    inputs = wander(*input_limits(block), rng, pace, max(n // pace, 3) + 2)
    inputs = np.resize(inputs, (n, inputs.shape[1]))
    if isinstance(block, Adaptive | AdaptiveSeries):
        # measured as on a plant that is 5 % off: of nonsense, rounding decides what is believed
        m = len(block.measured)
        inputs[1:, -m:] = 1.05 * inputs[:-1, :m] + 0.02 * rng.normal(size=(n - 1, m))
        inputs[0, -m:] = 1.05 * inputs[0, :m]
    return inputs


def nearby(block: Block, rng: np.random.Generator) -> Block:
    """Return a block of other parameters, as far as they make one."""
    parameters = block.pack()
    for size in (0.1, 0.03, 0.01, 0.0):
        try:
            return block.unpack(parameters * (1 + size * rng.uniform(-1, 1, parameters.size)))
        except ModelError:
            continue
    return block


def simulated(block: Block, inputs: Array) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return block.simulate(inputs, sample_time=SAMPLE_TIME)


def difference(outputs: Array, expected: Array) -> float:
    """Return the largest difference, relative to the range of each output."""
    span = np.ptp(expected, axis=0) + 1e-6 * np.abs(expected).max(axis=0) + 1e-300
    return float((np.abs(outputs - expected) / span).max())

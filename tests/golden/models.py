"""Models that golden cases run, and the inputs that they run over.

Models are made by public names only: registered kinds and printed models by name, compositions by the
package's own classes. Inputs are written here, so that they stay when a block's own limits change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mckibben import GPI, PI, Block, Channel, Parallel, PerChannel, Series
from mckibben.blocks.dynamics.state_network import StateNetwork
from mckibben.papers.paper import printed, printed_models
from mckibben.registry import load, names
from tests.golden.running import SAMPLE_TIME, Array

N_SAMPLES = 180

RANGES: dict[str, tuple[tuple[float, float], ...]] = {
    "air": ((0.0, 10.0),),
    "braid-equilibrium": ((0.0, 8.0),),
    "chou-hannaford": ((3.0, 5.5), (0.0, 5.0)),
    "force-compensator": ((100.0, 500.0), (180.0, 195.0)),
    "exponential": ((0.0, 4.5),),
    "force-feedforward": ((-5.0, 100.0), (0.0, 2.0)),
    "inverse": ((4.5, 29.5),),
    "load-estimate": ((0.0, 8.0), (0.0, 8.0), (0.0, 4.0), (0.0, 4.0), (0.0, 3.0)),
    "polynomial": ((-1.0, 9.0),),
    "predictive": ((4.5, 29.5),),
    "recurrent-fuzzy-network": ((0.0, 45.0), (0.0, 150.0)),
    "tondu-lopez": ((3.8, 5.0), (0.0, 5.0)),
    "adaptive": ((4.5, 29.5), (0.0, 0.0)),
    "adaptive series": ((6.5, 25.5), (0.0, 0.0)),
    "feedforward-feedback": (
        (0.0, 8.0),
        (0.0, 8.0),
        (0.0, 0.0),
        (0.0, 0.0),
        (0.0, 3.0),
        (0.0, 9.0),
    ),
    "published activation-pressure-profile": ((0.0, 0.25), (0.0, 200.0)),
    "published field-models-p2uz": ((1.0, 5.5),),
    "published field-models-pi": ((1.0, 5.5),),
    "published mpi-narmax-mpi": ((0.0, 10.0),),
    "published multistate-static-force": ((165.0, 200.0), (0.0, 5.0)),
    "published multistate-friction": ((165.0, 200.0), (0.0, 5.0)),
    "published sdchm-coupling": ((0.0, 40.0),) * 3,
    "air and muscle": ((0.0, 10.0),),
    "MPI-NARMAX": ((0.0, 5.0), (0.0, 150.0)),
    "adaptive gpi": ((-7.0, 10.0), (0.0, 0.0)),
    "predictive, all limits": ((-7.0, 10.0),),
    "predictive balance": ((0.0, 6.0), (0.0, 6.0), (0.0, 3.0), (0.0, 9.0)),
    "adaptive balance": ((0.0, 6.0), (0.0, 6.0), (0.0, 3.0), (0.0, 9.0), (0.0, 0.0), (0.0, 0.0)),
    "crowded muscles": ((0.0, 8.0), (-4.0, 6.0), (0.0, 3.0), (0.0, 9.0)),
    "predictive crowded muscles": ((0.0, 8.0), (-4.0, 6.0), (0.0, 3.0), (0.0, 9.0)),
    "adaptive crowded muscles": (
        *((1.0, 17.0), (-7.0, 13.0), (0.0, 3.0)),
        *((0.0, 9.0), (0.0, 0.0), (0.0, 0.0)),
    ),
    "multistate-friction each way": ((0.0, 2.0), (0.0, 5.0)),
    "force-feedforward by chou-hannaford": ((-5.0, 100.0), (4.2, 5.5)),
    "force-feedforward by tondu-lopez": ((-5.0, 100.0), (3.8, 5.0)),
    "fuzzy-network of crossed muscles": ((0.0, 20.0),) * 3,
    "recurrent-fuzzy-network with lags": ((0.0, 45.0), (0.0, 150.0)),
    "load-estimate, settled": ((0.0, 8.0), (0.0, 8.0), (0.0, 4.0), (0.0, 4.0), (0.0, 3.0)),
    "load-estimate with tare": ((0.0, 8.0), (0.0, 8.0), (0.0, 4.0), (0.0, 4.0), (0.0, 3.0)),
    "adaptive gpi, forgetting": ((-7.0, 10.0), (0.0, 0.0)),
    "adaptive balance, forgetting": (
        *((0.0, 6.0), (0.0, 6.0), (0.0, 3.0)),
        *((0.0, 9.0), (0.0, 0.0), (0.0, 0.0)),
    ),
}
"""Lowest and highest value of every input; 0 to 5 where nothing is said."""

SLOW = {"published mpi-narmax-mpi": 20}
"""Times as slow as others, since its output grows with the ninth power of the input's rate."""

STRAY = {"adaptive gpi, forgetting": 1.6, "adaptive balance, forgetting": 2.2}
"""What a plant answers in the second half of a run, by what is asked; 1.05 before, and of others.

Before, the sensors of these stick for a while."""

MEASURED = "_measured"
"""Inputs named so are what a plant answers, 5 % more than was asked for a sample ago."""


def example(kind: str, **changes: Any) -> Any:
    """Return the example of a registered kind, with other fields."""
    return replace(load("blocks", kind).example(), **changes)


def block(kind: str, *fields: Any, **named: Any) -> Any:
    """Return a block of a registered kind."""
    return load("blocks", kind)(*fields, **named)


def _numbered(stem: str, n: int = 3) -> tuple[Channel, ...]:
    return tuple(Channel(f"{stem}_{k}", "mm") for k in range(1, n + 1))


def _manipulator() -> Block:
    """Return hysteresis of three muscles, coupling, and rules scheduled by an extensor."""
    free, coupled, given = map(
        _numbered, ("displacement_free", "displacement_coupled", "displacement")
    )
    muscles = tuple(
        example(kind, input=Channel(f"pressure_{k}", "bar"), output=free[k - 1])
        for k, kind in enumerate(("pi", "gpi", "eupi"), start=1)
    )
    gains = ((1.0, 0.1, 0.05), (0.08, 1.0, 0.1), (0.02, 0.12, 1.0))
    consequents = tuple(
        1.0 + 0.1 * rule / 16 if i == j else 0.05 * (i - 1)
        for rule in range(16)
        for j in range(3)
        for i in range(4)
    )
    rules = block(
        "fuzzy-network",
        ((0.0, 20.0),) * 3 + ((0.0, 2.5),),
        ((15.0, 15.0),) * 3 + ((1.0, 1.2),),
        consequents,
        coupled,
        given,
        (Channel("pressure_extensor", "bar"),),
        False,
        ((-40.0, 60.0),) * 3,
    )
    return Series((PerChannel(muscles), block("coupling", gains, free, coupled), rules))


def _joint() -> Block:
    """Return two muscles in balance that move one coordinate."""
    balance = example("balance")
    angle = Channel("angle", "mm")
    return Series(
        (balance.inverse(), block("coupling", ((0.5,), (-0.5,)), balance.driven, (angle,)))
    )


def _crowded(**changes: Any) -> Any:
    """Return three muscles that move two coordinates against obstacles, with all that a balance has."""
    three = {
        name: (*rows, rows[0])
        for name, rows in vars(example("balance")).items()
        if name in ("elasticity", "areas", "friction", "relaxation", "damping", "lines", "walls")
    }
    return example(
        "balance",
        **three,
        hull=((-20.0, 50.0),) * 3,
        bladders=(2.0, 3.0, 2.0),
        pushes=(60.0, 50.0, 40.0),
        given=tuple(Channel(f"pressure_{k}", "bar") for k in (1, 2, 3)),
        pressure_range=(0.0, 6.0),
        highest_pressure=6.0,
        limits=(3.25, 13.0),
        friction_growth=6.0 / 6.5,
        friction_slopes=(0.2 / 6.5,),
        asymmetry=0.7,
        obstacles=(
            (1.0, 5.0, 4.0, 1.0, -1.0, 1.0, 3.0, 0.0),
            (1.0, 4.0, 6.0, 0.0, -1.0, -2.0, 5.0, 1.0),
        ),
        directions=((0.9, 0.0), (-0.4, 0.7), (-0.5, -0.8)),
        preload=1.0,
        **changes,
    )


DRIVE = ((2.0, 1.0, 0.0), (2.5, -0.5, 0.8), (2.2, -0.5, -0.9))
"""The middle of pressures, and two directions in which they were driven [bar]."""


def _crowded_series() -> Block:
    """Return those behind valves with dead times and dead zones, and before sensors."""
    balance = _crowded()
    valves, zones = [], []
    for k, given in enumerate(balance.given, 1):
        command, there = Channel(f"voltage_{k}", "V"), Channel(f"pressure_measured_{k}", "bar")
        valves.append(example("air", input=command, output=there, dead_time=2 * SAMPLE_TIME))
        zones.append(example("contact", input=there, output=given))
    sensors = tuple(
        block("affine", 2.0, 1.0, driven, Channel(f"sensor_{k}", "V"))
        for k, driven in enumerate(balance.driven, 1)
    )
    before = PerChannel(tuple(valves)), PerChannel(tuple(zones))
    return Series((*before, balance.inverse(), PerChannel(sensors)))


def _loaded_network() -> Block:
    network = example("recurrent-fuzzy-network")
    return Series((example("pi", output=network.driven[0]), network))


def _filters() -> Block:
    """Return a filter of either pressure for one displacement, and of the second for another."""
    first, second = (Channel(f"pressure_{k}", "bar") for k in (1, 2))
    one, other = _numbered("displacement", 2)
    return Parallel(
        (
            block(
                "transfer-function", (0.2, -0.05), (-0.7, 0.1), SAMPLE_TIME, input=first, output=one
            ),
            block(
                "transfer-function",
                (0.0, 0.4),
                (-0.5,),
                SAMPLE_TIME,
                1.0,
                2.0,
                input=second,
                output=one,
            ),
            block(
                "transfer-function",
                (0.3,),
                (-0.9,),
                SAMPLE_TIME,
                initial="virgin",
                input=second,
                output=other,
            ),
        )
    )


def _compositions() -> dict[str, Block]:
    balance = example("balance")
    feedforward = example("force-feedforward")
    pi, gpi, creep = PI.example(), GPI.example(), example("creep")
    return {
        "creeping muscle": Series((pi, creep)),
        "muscles in parallel": Parallel((pi, gpi)),
        "filters of several channels": _filters(),
        "air and muscle": Series((example("air"), pi)),
        "muscle behind contact": Series((example("contact"), gpi)),
        "network of two outputs": network(),
        "SDCHM": _manipulator(),
        "MPI-NARMAX": _loaded_network(),
        "joint": _joint(),
        "heavy muscles": example("balance", mass=(0.01, 0.02), pushes=(), bladders=()),
        "slack muscles": example("balance", pushes=(8.0, 2.0)),
        "limited muscles": example("balance", pressure_range=(0.0, 1.2)),
        "crowded muscles": _crowded(),
        "driven muscles": _crowded(drive=DRIVE),
        "adaptive crowded muscles": block("adaptive", _crowded_series(), 20.0, 0.1),
        "predictive crowded muscles": block("predictive", _crowded(), 4, 40.0),
        "adaptive gpi": block("adaptive", gpi, 20.0, 0.05),
        "adaptive series": block("adaptive", Series.example(), 60.0, 0.05),
        "adaptive balance": block("adaptive", balance.inverse(), 20.0, 0.05),
        "predictive, all limits": block(
            "predictive",
            gpi.inverse(),
            10,
            rate_limit=30.0,
            pressure_range=(0.2, 4.6),
        ),
        "predictive balance": block("predictive", balance, 6, 40.0, (0.0, 4.0)),
        "pi from a given memory": replace(pi, initial=(0.1, 0.2, 0.3, 0.4)),
        "force after known friction": replace(
            feedforward, friction=replace(feedforward.friction, initial=(0.5, -0.2, 0.1, 2.0))
        ),
        **{
            f"virgin {kind}": example(kind, initial="virgin")
            for kind in ("air", "pi", "gpi", "preisach", "duhem", "bouc-wen", "eupi")
        },
    }


def _lagged_network() -> Block:
    """Return a recurrent network of two past outputs, inputs and loads."""
    centres, loads, widths, spans = (5.0, 30.0), (20.0, 120.0), (30.0, 40.0), (90.0, 120.0)
    n, kinds = 8, 5  # x: two outputs, three inputs; three loads
    weights = (0.5, 0.12, 0.2, 0.1, -0.05, -0.01, 0.006, 0.003)
    consequents = tuple(
        value
        for rule in range(2**n)
        for value in (*((1.0 + 0.1 * (rule % 7) / 7) * w for w in weights), 0.2 + 0.01 * (rule % 5))
    )
    return example(
        "recurrent-fuzzy-network",
        centres=(centres,) * kinds + (loads,) * (n - kinds),
        widths=(widths,) * kinds + (spans,) * (n - kinds),
        feedbacks=tuple((0.5 - 0.2 * k, 0.1 * k - 0.3) for k in range(n)),
        consequents=consequents,
        output_lags=2,
        input_lags=2,
        scheduling_lags=2,
    )


def _crossed() -> Block:
    """Return rules by which each displacement is mostly that of the next muscle."""
    consequents = tuple(
        1.0 + 0.05 * rule / 8 if i == (j + 1) % 3 else 0.05 * (i - j)
        for rule in range(8)
        for j in range(3)
        for i in range(3)
    )
    sets = ((0.0, 20.0),) * 3, ((15.0, 15.0),) * 3
    channels = _numbered("displacement_coupled"), _numbered("displacement"), ()
    return block("fuzzy-network", *sets, consequents, *channels, False, ((-40.0, 60.0),) * 3)


def _variants() -> dict[str, Block]:
    """Return registered kinds off their examples, with what those do not run."""
    memory = example("coupled-memory")
    products = (0.02, -0.03, 0.015, -0.01)
    friction = block(
        "multistate-friction", ("both", "shared"), (20, 0.4, 2, 20, 0.5, 20, 30, 0.3, 4, 0.1, 6)
    )
    pulling = replace(friction, pressure_gain=0.01, reference_pressure=2.0)
    past = {"output_lags": 2, "input_lags": 2, "delay": 1, "thresholds": (0.1, 0.4)}
    two_rests = example(
        "narx-polynomial",
        **past,
        terms=((), (0,), (1,), (2,), (3,), (4,), (5,), (0, 0, 1), (1, 3)),
        weights=(0.001, 0.8, 0.22, 0.02, -0.012, 0.015, 0.02, -0.1, -0.01),
    )
    unit = (0.5, -0.2, 1.0, 0.4, -0.5, 0.3, 0.1, 0.03)
    other = (-0.3, 0.2, 0.8, -0.1, 0.2, 0.4, -0.2, -0.02)
    network = example(
        "narx-network",
        **past,
        bias=0.01,
        linear=(0.8, 0.12, 0.05, 0.03, 0.02, -0.01),
        hidden=unit + other,
    )
    balance = example("balance")
    return {
        "bouc-wen squared": example("bouc-wen", exponent=2),
        "bouc-wen squared, of no decay": example("bouc-wen", exponent=2, sigma=0.5),
        "bouc-wen of no decay": example("bouc-wen", sigma=0.5),
        "generalized-bouc-wen squared": example("generalized-bouc-wen", exponent=2),
        "coupled-memory of degree 3": replace(
            memory, degree=3, readout=((*memory.readout[0], *products),)
        ),
        "coupled-memory of crossed inputs": replace(
            memory,
            lags=(0.0, 0.5),
            crossed=True,
            readout=((*memory.readout[0], *np.linspace(0.02, -0.03, 12).tolist()),),
        ),
        "multistate-friction each way": pulling,
        "force-feedforward by chou-hannaford": block(
            "force-feedforward", example("chou-hannaford"), pulling
        ),
        "force-feedforward by tondu-lopez": block(
            "force-feedforward", example("tondu-lopez", kappa=(0.0, 1.1)), friction
        ),
        "fuzzy-network of crossed muscles": _crossed(),
        "recurrent-fuzzy-network with lags": _lagged_network(),
        "narx-polynomial with lags": two_rests,
        "virgin narx-polynomial with lags": replace(two_rests, initial="virgin"),
        "narx-network with lags": network,
        "narx-network without rest": replace(network, bias=0.4, activation="wavelet"),
        "settled balance": replace(balance, settled=True),
        "load-estimate, settled": block("load-estimate", replace(balance, settled=True)),
        "load-estimate with tare": block("load-estimate", replace(balance, tare=True)),
        "adaptive gpi, forgetting": block("adaptive", GPI.example(), 1.0, 0.05),
        "adaptive balance, forgetting": block("adaptive", balance.inverse(), 1.0, 0.05),
    }


def _of_envelopes() -> dict[str, Block]:
    found: dict[str, Block] = {}
    for kind in names("envelopes"):
        rising, falling = load("envelopes", kind).examples()
        found[f"gpi {kind}"] = replace(GPI.example(), rising=rising, falling=falling)
    return found


def network() -> StateNetwork:
    """Return a network of two inputs, one of which schedules, and two outputs."""
    return StateNetwork(
        linear=(
            (0.0, 1.0, 0.0, 0.3, 0.0, 0.0),
            (-1.5, -0.4, 0.2, 1.0, -0.5, 0.1),
            (0.0, 0.3, -0.6, 0.0, 0.4, 0.0),
            (1.0, 0.0, 0.2, 0.0, 0.1, 0.0),
            (0.0, 0.5, 1.0, 0.1, 0.0, 0.2),
        ),
        hidden=((1.0, 0.1, 0.0, 0.3, -0.2, 0.1), (0.2, 1.0, 0.4, 0.1, 0.5, -0.2)),
        readout=((0.0, 0.02), (0.6, -0.2), (0.1, 0.2), (0.3, 0.0), (-0.2, 0.4)),
        rate=15.0,
        input_offset=(2.0, 10.0),
        input_scale=(3.0, 20.0),
        output_offset=(1.0, 0.0),
        output_scale=(5.0, 40.0),
        driven=(Channel("pressure", "bar"),),
        scheduled=(Channel("length", "mm"),),
        given=(Channel("displacement", "mm"), Channel("force", "N")),
        substeps=2,
    )


def registered() -> dict[str, Block]:
    """Return an example of every registered kind, and every printed model."""
    found: dict[str, Block] = {kind: example(kind) for kind in names("blocks")}
    return found | {f"published {name}": printed(name) for name in printed_models()}


def all_models() -> dict[str, Block]:
    """Return all models by name."""
    return registered() | _compositions() | _variants() | _of_envelopes()


def path(seed: int, n: int = N_SAMPLES) -> Array:
    """Return a path within 0 and 1: a major loop, nested loops, random turns, each with a rest."""
    rng = np.random.default_rng(seed)
    loops = (0.1, 1.0, 0.0, 1.0, 0.3, 0.8, 0.45, 0.7) if seed % 10 == 0 else ()
    turns = np.concatenate([loops, rng.random(24)])
    on_the_way = 5 + np.floor(9 * rng.random(turns.size))
    at_rest = np.floor(5 * rng.random(turns.size))
    places = np.cumsum(np.column_stack([on_the_way, at_rest + 1]).ravel())
    return np.interp(np.arange(n), places, np.repeat(turns, 2))


def between(ranges: Sequence[tuple[float, float]], seed: int = 0, n: int = N_SAMPLES) -> Array:
    """Return a path in each range, shape (n, channels)."""
    return np.column_stack(
        [low + (high - low) * path(seed + k, n) for k, (low, high) in enumerate(ranges)]
    )


def inputs_of(name: str, model: Block, seed: int = 0, n: int = N_SAMPLES) -> Array:
    """Return inputs of a model, shape (n, n_inputs)."""
    channels = [channel.name for channel in model.inputs]
    ranges, slow = RANGES.get(name, ((0.0, 5.0),) * len(channels)), SLOW.get(name, 1)
    inputs = between(ranges, seed, n)
    if slow > 1:
        instants = np.arange(n) / slow
        inputs = np.column_stack([np.interp(instants, np.arange(n), line) for line in inputs.T])
    for place, channel in enumerate(channels):
        if channel.endswith(MEASURED):
            asked = inputs[:, channels.index(channel.removesuffix(MEASURED))]
            gains = np.where(np.arange(1, n) < n // 2, 1.05, STRAY.get(name, 1.05))
            inputs[1:, place] = gains * asked[:-1] + 0.02 * path(seed + 50 + place, n)[1:]
            inputs[0, place] = asked[0]
            if name in STRAY:
                inputs[n // 4 : n // 4 + 12, place] = inputs[n // 4, place]
    if model.n_missable:
        inputs[n // 2 : n // 2 + 8, -model.n_missable :] = np.nan
    return inputs

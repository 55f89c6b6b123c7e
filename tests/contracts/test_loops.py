"""A block in a loop is given what it names, in its unit, or refused before the plant moves."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from mckibben import (
    PI,
    Affine,
    Channel,
    DataError,
    MckibbenError,
    PerChannel,
    Recording,
    load_rig,
    registry,
)
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.feedback import FeedforwardFeedback, PIDFeedback
from mckibben.blocks.laws import examples
from mckibben.control import (
    BlockController,
    DisturbanceObserver,
    EstimatedLoad,
    Twin,
    control_law,
    track,
)
from mckibben.control.connecting import rest_length_of
from mckibben.control.tuning import tune_pid, untuned_pid
from mckibben.recording import MEASURED
from mckibben.rigs import Rig
from mckibben.rigs.files import rig_names
from tests.refusals import refused

STEPS = 4
BAR, MM = "bar", "mm"


def compensators() -> Iterator[tuple[str, Block]]:
    """Yield the inverse of every registered block that has one, and blocks that give commands."""
    for title, block in examples().items():
        with suppress(MckibbenError):
            yield f"inverse of {title}", block.inverse()
        if any(channel.name.startswith(("pressure", "voltage")) for channel in block.outputs):
            yield title, block


BLOCKS: dict[str, Block] = {}
for _title, _block in compensators():
    if _block not in BLOCKS.values():
        BLOCKS[_title] = _block


def named(block: Any, inputs: str, outputs: str) -> Any:
    """Return a block of one input and one output with other names, in the package's units."""
    units = {"pressure": BAR, "displacement": MM, "length": MM, "contraction": "", "voltage": "V"}
    ends = (Channel(name, units[name.partition("_")[0]]) for name in (inputs, outputs))
    return replace(block, **dict(zip(("input", "output"), ends, strict=True)))


PLANTS: dict[str, Callable[[], Any]] = {
    **{name: partial(load_rig, name) for name in rig_names()},
    "twin": lambda: Twin(PI.example(), rest_length=200.0),
    "twin of unknown length": lambda: Twin(PI.example()),
    "twin of length": lambda: Twin(named(PI.example(), "pressure", "length"), rest_length=200.0),
    "twin of voltage": lambda: Twin(named(PI.example(), "voltage", "displacement")),
    "twin of two": lambda: Twin(pair(2, 1), rest_length=200.0),
    "twin of an arm": lambda: Twin(
        Balance.example().inverse(),
        limits={f"pressure_{k}": (0.0, 5.0) for k in (1, 2)},
        rest_length=600.0,
    ),
}


def pair(*order: int) -> Block:
    """Return two muscles side by side, their channels in some order."""
    ends = [(f"pressure_{k}", f"displacement_{k}") for k in order]
    return PerChannel(tuple(named(PI.example(), *names) for names in ends))


@dataclass
class Seen:
    """What plants and blocks were given, and what blocks gave."""

    moves: int = 0
    given: dict[int, list[np.ndarray]] = field(default_factory=dict)
    gave: dict[int, list[np.ndarray]] = field(default_factory=dict)


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> Seen:
    """Watch every stream, rig and twin."""
    found = Seen()
    step = Stream.step

    def watched(self: Stream, inputs: Any) -> np.ndarray:
        found.given.setdefault(id(self.block), []).append(np.array(inputs, dtype=float))
        out = step(self, inputs)
        found.gave.setdefault(id(self.block), []).append(out.copy())
        return out

    monkeypatch.setattr(Stream, "step", watched)
    for plant in (Rig, Twin):
        for name in ("reset", "step"):
            original = getattr(plant, name)

            def counted(self: Any, *given: Any, original: Any = original, **more: Any) -> Any:
                found.moves += 1
                return original(self, *given, **more)

            monkeypatch.setattr(plant, name, counted)
    return found


VALUES = {"displacement": 20.0, "length": 170.0, "angle": 0.1, "force": 40.0, "torque": 1.0}


def wanted(plant: Any, way: str) -> Recording:
    """Return a reference of unlike numbers for all that a plant can follow or hold, given in a way."""
    channels: dict[str, float] = {}
    for place, name in enumerate(dict.fromkeys((*plant.outputs, *plant.inputs))):
        stem = name.partition("_")[0]
        if stem in VALUES:
            value = VALUES[stem] + 0.37 * place
            if name in plant.inputs and not isinstance(plant, Twin):
                limits = plant.limits(name)
                value = limits.low + (0.5 + 0.01 * place) * (limits.high - limits.low)
            if stem in ("displacement", "length") and way != "measured":
                length = rest_length_of(plant) or 200.0
                short = value if stem == "displacement" else length - value
                name = way + name.removeprefix(stem)
                value = as_measure(way, short, length)
            channels[name] = value
        elif name == "pressure_extensor":
            channels[name] = 1.03
    return Recording({name: np.full(STEPS, value) for name, value in channels.items()}, 0.02)


def as_measure(stem: str, displacement: float, length: float) -> float:
    """Return a displacement as another measure of the same."""
    measures = {"contraction": displacement / length, "length": length - displacement}
    return measures.get(stem, displacement)


def truth(channel: str, row: dict[str, float], length: float | None) -> float | None:
    """Return what a channel is, by its name, where a row has it or another measure of the same."""
    if channel in row:
        return row[channel]
    stem, _, rest = channel.partition("_")
    if stem not in ("displacement", "length", "contraction") or length is None:
        return None
    known = {name.partition("_")[0]: value for name, value in row.items() if _of(name) == rest}
    if "displacement" in known:
        return as_measure(stem, known["displacement"], length)
    if "length" in known:
        return as_measure(stem, length - known["length"], length)
    if "contraction" in known:
        return as_measure(stem, length * known["contraction"], length)
    return None


def _of(name: str) -> str:
    return name.partition("_")[2]


def check(
    block: Block, plant: Any, reference: Recording, seen: Seen, found: Recording, sends: bool = True
) -> None:
    """Compare what a block was given and what the plant was, with what names and units say."""
    length = rest_length_of(plant)
    rows = seen.given[id(block)]
    assert len(rows) == STEPS
    for t, (row, gave) in enumerate(zip(rows, seen.gave[id(block)], strict=True)):
        asked = {name: float(reference[name][t]) for name in reference.channels}
        shown = {name: float(found[name][t]) for name in plant.outputs}
        for place, (channel, value) in enumerate(zip(block.inputs, row, strict=True)):
            name = channel.name
            if name.endswith(MEASURED):
                expected = truth(name.removesuffix(MEASURED), shown, length)
            elif name.endswith("_base"):
                continue
            elif place < block.n_driven:
                expected = truth(name, asked, length)
            else:
                expected = truth(name, asked, length)
                expected = truth(name, shown, length) if expected is None else expected
            assert expected is not None, name
            assert value == pytest.approx(expected, rel=1e-12), name
        for channel, value in zip(
            block.outputs if sends else (), gave if sends else (), strict=True
        ):
            name = channel.name.removeprefix("command_")
            limits = plant.limits(name)
            sent = found[f"command_{name}"][t]
            assert sent == min(max(value, limits.low), limits.high), name
            assert channel.unit == found.units[f"command_{name}"]


def closed(controller: Any, plant: Any, reference: Recording) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return track(controller, plant, reference, approach=0.0, pressure_loop=False, preview=0.0)


@pytest.mark.parametrize("way", ["measured", "displacement", "contraction", "length"])
@pytest.mark.parametrize("name", PLANTS)
def test_every_block_is_given_what_it_names_or_is_refused(name: str, way: str, seen: Seen) -> None:
    connected = []
    for title, block in BLOCKS.items():
        plant = PLANTS[name]()
        reference = wanted(plant, way)
        seen.moves, seen.given, seen.gave = 0, {}, {}
        found = None
        with suppress(MckibbenError):
            found = closed(block, plant, reference).recording
        if found is None:
            assert seen.moves == 0, title
            continue
        watched = block.compensator if isinstance(block, FeedforwardFeedback) else block
        check(watched, plant, reference, seen, found, watched is block)
        connected.append(title)
    unknown = name in ("twin of unknown length", "twin of voltage") and way in (
        "contraction",
        "length",
    )
    expected = {
        "mckibben-530": {"activation-memory", "activation-pressure", "inverse of pi"},
        "mas20-hanging": {"inverse of pi", "predictive"},
        "mas10-test-stand": {"force-feedforward"},
        "twin": {"inverse of pi", "predictive", "pi-adaptive"},
        "twin of length": {"inverse of pi", "predictive", "pi-adaptive"},
        "twin of two": {"inverse of per-channel"},
        "twin of an arm": {"balance", "feedforward-feedback"},
    }
    assert expected.get(name, set()) <= set(connected)
    if unknown:
        assert connected == []


@pytest.mark.parametrize("law", registry.names("controllers"))
@pytest.mark.parametrize("measure", ["displacement", "contraction", "length"])
def test_laws_go_by_what_their_compensator_names(law: str, measure: str, seen: Seen) -> None:
    plant = PLANTS["twin"]()
    block = named(PI.example(), "pressure", measure).inverse()
    tuned = untuned_pid(plant, references=block.inputs)
    assert tuned.driven == block.inputs
    controller = control_law(law, block, lambda: replace(tuned, kp=(0.1,), ki=(0.2,)))
    reference = wanted(plant, "contraction")
    seen.given, seen.gave = {}, {}
    found = closed(controller, plant, reference).recording
    watched = controller if law == "pid" else block
    assert isinstance(watched, Block)
    if law == "observer":  # which asks for the reference without its estimate
        first = seen.given[id(block)][0]
        assert first == pytest.approx(truth(measure, {"displacement": 20.0}, 200.0))
    else:
        check(watched, plant, reference, seen, found, law != "feedforward-pid")


@pytest.mark.parametrize("behind", [False, True])
def test_feedback_is_in_the_unit_of_its_compensator(behind: bool) -> None:
    """Gains are per contraction where that is fed back, and give what those per millimetre give."""
    plant = PLANTS["twin"]()
    reference = wanted(plant, "displacement")
    results = []
    for measure, scale in (("displacement", 1.0), ("contraction", 1 / 200.0)):
        block = named(PI.example(), "pressure", measure)
        scaled = {"weights": tuple(scale * np.array(block.weights)), "offset": scale * block.offset}
        block = replace(block, **scaled).inverse()
        pid = tune_pid(plant, sample_time=0.02, hold=2.0, references=block.inputs)
        assert pid.driven == block.inputs
        controller = control_law(
            "feedforward-pid" if behind else "pid", block, partial(replace, pid)
        )
        results.append(closed(controller, plant, reference).recording["command_pressure"])
    np.testing.assert_allclose(results[0], results[1], rtol=1e-9)
    contraction = named(PI.example(), "pressure", "contraction").inverse()
    with refused(MckibbenError, names="references=compensator"):
        FeedforwardFeedback.of(contraction, tune_pid(plant, sample_time=0.02, hold=2.0))


@pytest.mark.parametrize("order", [(1, 2), (2, 1)])
def test_the_order_of_channels_does_not_matter(order: tuple[int, int], seen: Seen) -> None:
    plant = PLANTS["twin of two"]()
    pid = PIDFeedback.of(
        tuple(Channel(f"displacement_{k}", MM) for k in order),
        tuple(Channel(f"pressure_{k}", BAR) for k in order),
        [0.1 * k for k in order],
        [0.0, 0.0],
        limits=(0.0, 5.0),
    )
    reference = wanted(plant, "measured")
    inverse = pair(*order).inverse()
    other = pair(*order[::-1]).inverse()
    runs = []
    for controller in (
        pid,
        inverse,
        FeedforwardFeedback.of(other, pid),
        DisturbanceObserver(other),
    ):
        seen.given, seen.gave = {}, {}
        found = closed(controller, plant, reference)
        runs.append(found.recording)
        if controller in (pid, inverse):
            check(controller, plant, reference, seen, found.recording)
    error = {k: reference[f"displacement_{k}"][0] for k in order}
    for k in order:  # at rest at 0
        sent = runs[0][f"command_pressure_{k}"][0]
        assert sent == pytest.approx(min(0.1 * k * error[k], 5.0))
        alone = runs[1][f"command_pressure_{k}"][0]
        both = runs[2][f"command_pressure_{k}"][0]
        assert both >= alone
        assert runs[3][f"command_pressure_{k}"][0] == alone
    assert FeedforwardFeedback.of(other, pid).feedback.kp == tuple(0.1 * k for k in order[::-1])


def test_an_estimate_is_made_of_what_it_names(seen: Seen) -> None:
    plant = PLANTS["mckibben-530"]()
    reference = wanted(plant, "measured")
    estimate = Affine(0.0, 40.0, Channel("contraction", ""), Channel("force", "N"))
    block = BLOCKS["activation-memory"]
    controller = EstimatedLoad(BlockController(block), estimate, filter_time=1e-9)
    found = closed(controller, plant, reference).recording
    length = rest_length_of(plant)
    assert length == 530.0
    for t in range(STEPS):
        assert seen.given[id(estimate)][t] == pytest.approx(found["displacement"][t] / length)
        assert seen.given[id(block)][t][1] == pytest.approx(40.0)
    voltage = Affine(1.0, 0.0, Channel("voltage", "V"), Channel("force", "N"))
    with refused(DataError, channel="voltage", names="displacement"):
        closed(EstimatedLoad(BlockController(block), voltage), plant, reference)


@pytest.mark.parametrize(
    ("block", "plant", "channel", "told"),
    [
        (named(PI.example(), "pressure", "contraction").inverse(), "twin of unknown length",
         "contraction", ("rest_length", "displacement")),
        (named(PI.example(), "voltage", "displacement").inverse(), "twin", "voltage",
         ("V", "pressure")),
        (PI.example().inverse(), "twin of voltage", "pressure", ("bar", "voltage")),
        (replace(PI.example(), output=Channel("displacement", "cm")).inverse(), "twin",
         "displacement", ("cm", "mm")),
        (replace(PI.example(), input=Channel("pressure", "kPa")).inverse(), "twin", "pressure",
         ("kPa", "bar")),
        (replace(PI.example(), output=Channel("angle", "rad")).inverse(), "twin", "angle",
         ("rad", "displacement")),
        (pair(1, 2).inverse(), "twin", "displacement_1", ("mm", "displacement")),
        (PI.example().inverse(), "twin of two", "displacement",
         ("mm", "displacement_1", "displacement_2")),
        (PI.example(), "twin", "pressure", ("bar", "displacement")),
    ],
)  # fmt: skip
def test_refusals_name_the_channel_and_a_remedy(
    block: Block, plant: str, channel: str, told: tuple[str, ...], seen: Seen
) -> None:
    there = PLANTS[plant]()
    with refused(DataError, channel=channel, names=told):
        closed(block, there, wanted(there, "measured"))
    assert seen.moves == 0


def test_a_reference_that_only_a_rest_length_makes_measured_is_refused_without_one() -> None:
    plant = PLANTS["twin of unknown length"]()
    reference = wanted(plant, "contraction")
    with refused(DataError, names=("displacement", "rest_length")):
        closed(PI.example().inverse(), plant, reference)
    found = closed(PI.example().inverse(), plant, reference.with_meta(rest_length=200.0))
    assert found.recording["reference_displacement"][-1] == pytest.approx(20.0)

"""Exported C gives Python's numbers, to the bit or nearly, for every block and composition."""

from __future__ import annotations

import ctypes
import subprocess
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import Block, Channel, ModelError, ModelWarning, Series
from mckibben.blocks.adaptive.adaptive import Adaptive
from mckibben.blocks.adaptive.adaptive_series import AdaptiveSeries
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork
from mckibben.blocks.coupled.recurrent_fuzzy_network import RecurrentFuzzyNetwork
from mckibben.blocks.feedback.feedforward_feedback import FeedforwardFeedback
from mckibben.blocks.laws.examples import examples
from mckibben.blocks.laws.trial import input_limits, wander
from mckibben.blocks.play_type.gpi import GPI
from mckibben.export import export_c
from mckibben.export.c.building import CompiledModel, self_test
from mckibben.registry import load, names
from mckibben.stream import Step
from tests.tools import needs

Array = NDArray[np.float64]

pytestmark = needs("cc")

SAMPLE_TIME = 0.01
DOUBLE, SINGLE, GROWN = 1e-12, 1e-4, 1e-8
"""Largest difference allowed, relative to the range."""

STEPS = 100_000
SLOW = {
    "balance-inverse",
    "slack balance inverse",
    "force-balance-inverse",
    "fuzzy-network-inverse",
    "recurrent-fuzzy-network",
}
"""Solved by Newton's method, or slow in Python: fewer steps."""


def channels(stem: str, unit: str, n: int = 3) -> tuple[Channel, ...]:
    return tuple(Channel(f"{stem}_{k}", unit) for k in range(1, n + 1))


def sdchm() -> Block:
    """Return hysteresis of three muscles, coupling, and a network scheduled by an extensor."""
    pressures, own = channels("pressure", "bar"), channels("displacement_free", "mm")
    coupled, given = channels("displacement_coupled", "mm"), channels("displacement", "mm")
    muscles = [
        replace(load("blocks", kind).example(), input=pressure, output=free)
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


def heavy() -> Block:
    """Return two muscles at which masses hang."""
    example = load("blocks", "balance").example()
    return replace(example, mass=(0.01, 0.02), pushes=(), bladders=())


def joint() -> Block:
    """Return two muscles in balance that move one coordinate."""
    balance = load("blocks", "balance").example()
    across = Coupling(((0.5,), (-0.5,)), balance.driven, (Channel("angle", "mm"),))
    return Series((balance.inverse(), across))


def mpi_narmax() -> Block:
    """Return a Prandtl-Ishlinskii model and a recurrent network behind it, under a load."""
    network = RecurrentFuzzyNetwork.example()
    return Series((replace(load("blocks", "pi").example(), output=network.driven[0]), network))


def virgin(kind: str) -> Block:
    return replace(load("blocks", kind).example(), initial="virgin")


def feedforward(initial: Any) -> Block:
    """Return a force feedforward whose friction starts from a memory of its own."""
    block = load("blocks", "force-feedforward").example()
    return replace(block, friction=replace(block.friction, initial=initial))


def slack() -> Block:
    """Return a balance of muscles that go slack."""
    return replace(load("blocks", "balance").example(), pushes=(8.0, 2.0))


MODELS: dict[str, Block] = {
    **examples(),
    "SDCHM": sdchm(),
    "SDIHC": sdchm().inverse(),
    "MPI-NARMAX": mpi_narmax(),
    "heavy muscles": heavy(),
    "heavy muscles inverse": heavy().inverse(),
    "joint": joint(),
    "joint inverse": joint().inverse(),
    "explicit start": replace(load("blocks", "pi").example(), initial=(0.1, 0.2, 0.3, 0.4)),
    **{
        f"virgin {kind}": virgin(kind)
        for kind in (
            *("air", "pi", "gpi", "preisach", "duhem"),
            *("krasnoselskii-pokrovskii", "maxwell-slip"),
        )
    },
    **{
        f"virgin {kind} inverse": virgin(kind).inverse()
        for kind in ("air", "pi", "gpi", "preisach", "duhem", "bouc-wen", "eupi")
    },
    "virgin narx": virgin("narx-network"),
    "slack balance": slack(),
    "slack balance inverse": slack().inverse(),
    "force after virgin friction": feedforward("virgin"),
    "force after known friction": feedforward((0.5, -0.2, 0.1, 2.0)),
}


def envelopes(kind: str) -> Block:
    rising, falling = load("envelopes", kind).examples()
    return replace(GPI.example(), rising=rising, falling=falling)


MODELS |= {f"gpi {kind}": envelopes(kind) for kind in names("envelopes")}
MODELS |= {f"gpi {kind} inverse": envelopes(kind).inverse() for kind in names("envelopes")}


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


def changed(block: Block, rng: np.random.Generator) -> Block:
    """Return a block of other parameters nearby, as far as they make one."""
    parameters = block.pack()
    for size in (0.1, 0.03, 0.01, 0.0):
        try:
            return block.unpack(parameters * (1 + size * rng.uniform(-1, 1, parameters.size)))
        except ModelError:
            continue
    return block


def compiled(block: Block, folder: Path, **settings: Any) -> CompiledModel:
    export_c(block, folder, name="muscle", sample_time=SAMPLE_TIME, **settings)
    return CompiledModel(folder, "muscle", len(block.inputs), len(block.outputs))


def simulated(block: Block, inputs: Array) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return block.simulate(inputs, sample_time=SAMPLE_TIME)


def difference(outputs: Array, expected: Array) -> float:
    """Return the largest difference, relative to the range of each output."""
    span = np.ptp(expected, axis=0) + 1e-6 * np.abs(expected).max(axis=0) + 1e-300
    return float((np.abs(outputs - expected) / span).max())


@pytest.mark.parametrize("name", MODELS)
def test_double_precision_is_python_and_a_parameter_changed_is_seen(
    name: str, tmp_path: Path
) -> None:
    """The comparison has teeth: a hair's change of one number in Python fails it."""
    block = changed(MODELS[name], np.random.default_rng(len(name)))
    n = 5_000 if block.title in SLOW or "SD" in name else STEPS
    inputs = path_for(block, 1, n)
    outputs, statuses = compiled(block, tmp_path / "c").run(inputs)
    assert not statuses.any()
    expected = simulated(block, inputs)
    if isinstance(block, Adaptive | AdaptiveSeries):  # what learns remembers rounding
        assert difference(outputs, expected) <= GROWN
        outputs, expected = outputs[:5_000], expected[:5_000]
    assert difference(outputs, expected) <= DOUBLE
    if block.n_parameters == 0:
        return
    parameters, few = block.pack(), slice(0, 2000)
    tried = seen = 0
    for place in np.unique(np.linspace(0, parameters.size - 1, 5).astype(int)):
        other = parameters.copy()
        other[place] = other[place] * (1 + 1e-6) + 1e-6
        try:
            expected = simulated(block.unpack(other), inputs[few])
        except ModelError:
            continue
        tried += 1
        seen += difference(outputs[few], expected) > DOUBLE
    assert seen >= 0.5 * tried > 0


@pytest.mark.parametrize("name", [*examples(), "SDCHM", "MPI-NARMAX", "virgin preisach inverse"])
def test_single_precision_is_near(name: str, tmp_path: Path) -> None:
    block = MODELS[name]
    inputs = path_for(block, 2, 20_000).astype(np.float32).astype(np.float64)
    if block.title in SLOW or "SD" in name:
        inputs = inputs[:3000]
    outputs, statuses = compiled(block, tmp_path / "c", single=True).run(inputs)
    assert not statuses.any()
    expected = simulated(block, inputs)
    if isinstance(block, FeedforwardFeedback):
        span = np.array(block.feedback.limits)
        assert (np.abs(outputs - expected) <= SINGLE * np.ptp(span)).all()
    else:
        assert difference(outputs, expected) <= SINGLE


def test_single_precision_inverse_gives_the_motion_wished_for(tmp_path: Path) -> None:
    """Where envelopes leave a plateau, several pressures give one displacement: any of them will do."""
    forward = sdchm()
    pressures = path_for(forward, 2, 3000)
    wanted = simulated(forward, pressures).astype(np.float32).astype(np.float64)
    references = np.column_stack([wanted, pressures[:, 3]])
    given, _ = compiled(forward.inverse(), tmp_path / "c", single=True).run(references)
    assert (
        difference(simulated(forward, np.column_stack([given, pressures[:, 3]])), wanted) <= SINGLE
    )


DRIFTING = (
    "creep",
    "gpi-inverse",
    "maxwell-slip",
    "multistate-friction",
    "narx-network",
    "pi",
    "preisach",
    "process-model",
)


@pytest.mark.parametrize("name", DRIFTING)
def test_single_precision_does_not_drift(name: str, tmp_path: Path) -> None:
    block = MODELS[name]
    inputs = path_for(block, 3, 1_000_000).astype(np.float32).astype(np.float64)
    outputs, _ = compiled(block, tmp_path / "c", single=True).run(inputs)
    expected = simulated(block, inputs)
    assert difference(outputs[-100_000:], expected[-100_000:]) <= SINGLE


@pytest.mark.parametrize("name", ["pi", "gpi-inverse", "SDCHM", "process-model"])
def test_bad_inputs_change_nothing(name: str, tmp_path: Path) -> None:
    """NaN and infinity are skipped: memory and outputs are as if they had never come."""
    block = MODELS[name]
    good = path_for(block, 4, 300)
    bad, kept = good.copy(), np.ones(len(good), dtype=bool)
    for row, value in ((0, np.nan), (7, np.inf), (8, -np.inf), (150, np.nan)):
        bad[row, row % good.shape[1]], kept[row] = value, False
    outputs, statuses = compiled(block, tmp_path / "c").run(bad)
    np.testing.assert_array_equal(statuses, np.where(kept, 0, 1))
    assert difference(outputs[kept], simulated(block, good[kept])) <= DOUBLE
    assert not outputs[0].any()
    np.testing.assert_array_equal(outputs[[7, 8, 150]], outputs[[6, 6, 149]])


def test_outputs_are_always_finite(tmp_path: Path) -> None:
    block = load("blocks", "polynomial")((0.0, 1e200, 1e200))
    outputs, statuses = compiled(block, tmp_path / "c").run([[1.0], [1e200], [2.0]])
    np.testing.assert_array_equal(statuses, [0, 2, 0])
    assert outputs[1] == outputs[0]


def test_reset_makes_the_next_step_a_first_one(tmp_path: Path) -> None:
    block = MODELS["SDIHC"]
    model, inputs = compiled(block, tmp_path / "c"), path_for(block, 5, 50)
    first, _ = model.run(inputs)
    model.reset()
    again, _ = model.run(inputs)
    np.testing.assert_array_equal(first, again)


def test_memory_lost_to_a_bad_output_starts_afresh(tmp_path: Path) -> None:
    """A huge sample that overflows the memory is told once, not for ever."""
    block = load("blocks", "pid").example()
    inputs = path_for(block, 6, 40)
    inputs[20, 2] = 1e308
    outputs, statuses = compiled(block, tmp_path / "c").run(inputs)
    assert 2 in statuses[20:24]
    assert not statuses[24:].any()
    step = Step(block, SAMPLE_TIME)
    np.testing.assert_allclose(outputs, [step(row) for row in inputs], rtol=1e-12)


def test_a_memory_that_points_outside_is_refused(tmp_path: Path) -> None:
    for initial in ((1000.0, 1.0), (0.0, 1.0), (1.5, 1.0), (-3.0, 1.0), (1.0, 0.5)):
        state = (*initial, *[0.0] * 130)
        block = replace(load("blocks", "preisach").example(), initial=state)
        for one in (block, block.inverse()):
            with pytest.raises(ModelError, match=r"has depth.*Remedy:"):
                compiled(one, tmp_path / "c")


def test_a_series_that_would_start_otherwise_is_refused(tmp_path: Path) -> None:
    block = Series((lagging("virgin"), load("blocks", "pi").example()))
    with pytest.raises(ModelError, match=r"Remedy: start it from 'first_sample'"):
        compiled(block, tmp_path / "c")
    compiled(Series((lagging("first_sample"), load("blocks", "pi").example())), tmp_path / "c")


@pytest.mark.parametrize(
    ("initial", "said"),
    [
        ("first_sample", "from its inputs."),
        ("virgin", "at rest, whatever its inputs."),
        ((0.1, 0.2, 0.3, 0.4), "as the model gives it."),
    ],
)
def test_what_is_written_says_how_memory_starts(initial: Any, said: str, tmp_path: Path) -> None:
    export_c(
        replace(load("blocks", "pi").example(), initial=initial), tmp_path / "c", name="muscle"
    )
    for file in ("README.md", "src/muscle.h"):
        words = " ".join((tmp_path / "c" / file).read_text().replace(" * ", " ").split())
        assert f"The first step starts the memory {said}" in words


def lagging(initial: str) -> Block:
    return replace(load("blocks", "process-model").example(), initial=initial)


def test_places_too_close_for_single_precision_are_refused(tmp_path: Path) -> None:
    block = load("blocks", "piecewise-linear")((0.0, 1.0, 1.0 + 1e-9, 2.0), (0.0, 1.0, 1.5, 2.0))
    with pytest.raises(ModelError, match=r"too close for single precision"):
        compiled(block, tmp_path / "c", single=True)
    compiled(block, tmp_path / "c")


def test_poles_too_slow_for_single_precision_are_told(tmp_path: Path) -> None:
    poles = np.poly([0.999, 0.998])
    block = load("blocks", "transfer-function")(
        (0.0, float(poles.sum())), tuple(poles[1:].tolist()), SAMPLE_TIME
    )
    with pytest.warns(ModelWarning, match=r"in single precision .* is off by about"):
        compiled(block, tmp_path / "c", single=True)


def test_models_of_both_precisions_live_in_one_program(tmp_path: Path) -> None:
    """Functions of each export have names of their own."""
    block = MODELS["pi"]
    inputs = path_for(block, 7, 50)
    for name, single in (("coarse", True), ("fine", False)):
        export_c(block, tmp_path / name, name=name, single=single)
    objects = []
    for name in ("coarse", "fine"):
        for source in sorted((tmp_path / name / "src").glob("*.c")):
            objects.append(source.with_suffix(".o"))
            subprocess.run(["cc", "-fPIC", "-c", source, "-o", objects[-1]], check=True)
    library = tmp_path / "both.so"
    subprocess.run(["cc", "-shared", *objects, "-lm", "-o", library], check=True)
    both = ctypes.CDLL(str(library))
    for name, kind, tolerance in (("coarse", np.float32, SINGLE), ("fine", np.float64, DOUBLE)):
        model, given = ctypes.create_string_buffer(4096), inputs.astype(kind)
        outputs = np.zeros((len(given), 1), kind)
        getattr(both, f"{name}_init")(model)
        step = getattr(both, f"{name}_step")
        step.argtypes = [ctypes.c_void_p] * 3
        for k in range(len(given)):
            place, into = given.ctypes.data + k * given.itemsize, outputs.ctypes.data
            step(ctypes.addressof(model), place, into + k * outputs.itemsize)
        assert difference(outputs.astype(float), simulated(block, inputs)) <= tolerance


def test_the_self_test_fails_for_another_model(tmp_path: Path) -> None:
    block = MODELS["pi"]
    own = export_c(block, tmp_path / "own", name="muscle")
    other = block.unpack(block.pack() * (1 + 1e-6))
    source = export_c(other, tmp_path / "other", name="muscle") / "src" / "muscle.c"
    assert "largest difference" in self_test(own, "muscle")
    (own / "src" / "muscle.c").write_bytes(source.read_bytes())
    with pytest.raises(ModelError, match="does not give Python's numbers"):
        self_test(own, "muscle")

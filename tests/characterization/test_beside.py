"""What is not the muscle's own changes no verdict: zeros of sensors, and other inputs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben import PI, DataError, Recording, read
from mckibben.characterization import characterize
from mckibben.characterization.beside import effects, without
from mckibben.signals import multisine, noise_level, zeroed
from tests.recordings import MEASURED

STEP = 0.01
TIME = np.arange(3000) * STEP
SLOW = 2.5 - 2.5 * np.cos(2 * np.pi * TIME / 10.0)
MUSCLE = PI((0.0, 0.4), (2.0, 4.0), 0.0, (0.0, 5.0))


def run(zero: float, seed: int) -> Recording:
    noise = 0.01 * np.random.default_rng(seed).standard_normal(TIME.size)
    return Recording({"pressure": SLOW, "displacement": MUSCLE.simulate(SLOW) + noise + zero}, STEP)


@given(st.lists(st.floats(-300, 300), min_size=2, max_size=4))
@settings(max_examples=10, deadline=None)
def test_zeros_of_recordings_change_no_verdict(zeros: list[float]) -> None:
    same = characterize([run(0.0, seed) for seed, _ in enumerate(zeros)])
    moved = characterize([run(zero, seed) for seed, zero in enumerate(zeros)])
    assert moved.depends
    assert moved.has_loop
    for name in ("loop_width", "gain", "dead_zone_upper", "branch_gap"):
        assert getattr(moved, name) == pytest.approx(getattr(same, name), rel=0.05, abs=0.02), name
    assert not same.assumed


def test_zeros_that_differ_are_told() -> None:
    found = characterize([run(0.0, 1), run(80.0, 2)])
    assert "rest at different displacement, from" in found.sentences[-1]
    low, high = found.output_range
    assert high - low == pytest.approx(np.ptp(run(0.0, 1)["displacement"]), rel=0.02)
    one = zeroed(run(0.0, 1), ["displacement"], "pressure")
    assert (low, high) == pytest.approx(  # no positions that never were
        (one["displacement"].min(), one["displacement"].max()), abs=0.1
    )


def test_curves_that_differ_from_length_to_length_hide_no_loop() -> None:
    steep = [
        Recording(
            {"pressure": SLOW, "force": gain * SLOW + 5 * np.sin(2 * np.pi * TIME / 10)}, STEP
        )
        for gain in (20.0, 60.0, 180.0)
    ]
    found = characterize(steep, output="force")
    assert found.has_loop
    assert found.p_loop is not None
    assert found.p_loop < 1e-6


def two(other: np.ndarray) -> Recording:
    """Return three cycles of one input, a rest, and whatever another input does in all that."""
    u = np.concatenate([SLOW, np.zeros(1000)])
    y = MUSCLE.simulate(u) + 7.0 * other
    noise = 0.005 * np.random.default_rng(3).standard_normal(u.size)
    return Recording({"pressure_1": u, "pressure_2": other, "displacement": y + noise}, STEP)


def test_what_another_input_does_is_not_taken_for_the_own() -> None:
    still = two(np.zeros(4000))
    ramps = np.concatenate([np.zeros(3000), np.linspace(0, 4, 500), np.full(500, 4.0)])
    clean = characterize(still, "pressure_1", "displacement")
    mixed = characterize(two(ramps), "pressure_1", "displacement")
    apart = characterize(two(ramps), "pressure_1", "displacement", beside=["pressure_2"])
    assert mixed.creep is not None
    assert abs(mixed.creep) > 5.0  # which is the other input's
    assert apart.creep is None or abs(apart.creep) < 0.1
    assert apart.loop_width == pytest.approx(clean.loop_width, rel=0.02)
    assert apart.sentences[-1].startswith("Told where pressure_2 rest")
    assert (mixed.n_recordings, mixed.n_stretches) == (1, None)
    assert apart.n_recordings == 1
    assert apart.n_stretches is not None
    assert apart.n_stretches > 1


def test_inputs_that_never_move_alone_are_told_without_what_others_do() -> None:
    other = 2 + 2 * np.sin(2 * np.pi * np.arange(4000) * STEP / 13)
    clean = characterize(two(np.zeros(4000)), "pressure_1", "displacement")
    found = characterize(two(other), "pressure_1", "displacement", beside=["pressure_2"])
    assert found.loop_width == pytest.approx(clean.loop_width, rel=0.2)
    assert [effect.change for effect in found.effects] == pytest.approx([28.0], rel=0.05)
    assert found.sentences[-1].startswith("As pressure_1 never moves while pressure_2 rests")


def test_inputs_that_move_as_one_are_refused() -> None:
    one = two(0.5 * np.concatenate([SLOW, np.zeros(1000)])).slice(0, 3000)
    with pytest.raises(DataError, match="never moves while pressure_2 rests"):
        characterize(one, "pressure_1", "displacement", beside=["pressure_2"])


def test_fast_motion_is_no_noise() -> None:
    wave = multisine(np.arange(8192) / 750, 8192 / 750, 150.0, 100.0, -100.0)
    assert np.isnan(noise_level(wave))
    hiss = np.random.default_rng(2).standard_normal(8192)
    assert noise_level(100 * np.sin(TIME) + hiss[: TIME.size]) == pytest.approx(1.0, rel=0.1)
    found = characterize(
        Recording({"pressure": wave, "displacement": MUSCLE.simulate(wave)}, 1 / 750)
    )
    assert found.input_noise is None
    assert found.n_reversals > 500


def test_an_output_that_falls_is_said_to() -> None:
    one = run(0.0, 1)
    turned = characterize(one.with_channels(displacement=-one["displacement"]))
    assert turned.falls
    assert "Displacement falls from" in turned.sentences[1]
    assert "with its sign turned" in turned.sentences[1]
    assert not characterize(one).falls


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_measured_muscles_of_several_zeros() -> None:
    files = sorted((MEASURED / "cavatappi_loads").glob("*.csv"))
    if not files:
        pytest.skip("the measured recordings are not here")
    found = characterize([one for file in files for one in read(file, gaps="interpolate")])
    assert found.p_dependence is not None
    assert found.p_dependence < 1e-6
    assert found.falls


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_a_measured_arm_creeps_little() -> None:
    files = sorted((MEASURED / "soft_arm_three_muscles").glob("*.csv"))
    if not files:
        pytest.skip("the measured recordings are not here")
    arm = [one for file in files for one in read(file)]
    found = characterize(arm, "voltage_1", "displacement_1", beside=["voltage_2", "voltage_3"])
    assert found.creep is not None
    assert abs(found.creep) < 5.0
    assert found.has_loop


def loaded(force: np.ndarray) -> Recording:
    """Return three cycles of the muscle, which gives way to a load whose sensor hisses."""
    rng = np.random.default_rng(4)
    y = MUSCLE.simulate(SLOW) - 0.02 * force + 0.01 * rng.standard_normal(TIME.size)
    hiss = force + 0.5 * rng.standard_normal(TIME.size)
    return Recording({"pressure": SLOW, "displacement": y, "force": hiss}, STEP)


def test_a_load_that_is_held_in_each_recording_moves_the_output_and_not_the_loop() -> None:
    clean = characterize(loaded(np.zeros(TIME.size)), beside=["force"])
    assert (clean.n_stretches, clean.effects) == (None, ())  # it rests throughout
    held = [loaded(np.full(TIME.size, load)) for load in (0.0, 150.0, 300.0)]
    found = characterize(held, beside=["force"])
    assert found.loop_width == pytest.approx(clean.loop_width, rel=0.03)
    (effect,) = found.effects
    assert (effect.channel, effect.unit) == ("force", "N")
    assert effect.change == pytest.approx(-0.02 * (effect.high - effect.low), rel=0.02)
    assert found.output_range[0] < -5.9  # as recorded, at the largest load
    assert found.sentences[2].startswith("At equal pressure, displacement falls by 6.1 mm")
    assert [row[1] for row in found.table() if row[0] == "effect of force"] == [effect.change]
    assert found.to_dict()["effects"][0]["channel"] == "force"


def isometric(length: float, gain: float, gap: float, seed: int) -> Recording:
    """Return three cycles of force at a length, whose branches are apart by some of its range."""
    lag = gap * np.sin(2 * np.pi * TIME / 10.0)
    noise = 0.5 * np.random.default_rng(seed).standard_normal(TIME.size)
    force = gain * (SLOW - lag) - 5 * length + noise
    still = np.full(TIME.size, length)
    return Recording({"pressure": SLOW, "displacement": still, "force": force}, STEP)


LENGTHS = ((0.0, 200.0, 0.1), (10.0, 140.0, -0.05), (20.0, 70.0, -0.2))
"""Held, with the gain there; loops that go round either way hide each other."""


@pytest.mark.parametrize("asked", [(), ("displacement",)])
def test_every_held_length_has_its_loop_and_its_gain(asked: tuple[str, ...]) -> None:
    runs = [isometric(*each, seed) for seed in range(2) for each in LENGTHS]
    found = characterize(runs, output="force", beside=asked)
    assert found.has_loop
    assert [level.held for level in found.levels] == [
        (("displacement", length, "mm"),) for length, _, _ in LENGTHS
    ]
    for level, (length, gain, gap) in zip(found.levels, LENGTHS, strict=True):
        alone = characterize(
            [isometric(length, gain, gap, seed) for seed in range(2)], output="force"
        )
        assert level.found.gain == pytest.approx(gain, rel=0.05)
        assert level.found.loop_width == alone.loop_width
        assert level.found.to_dict() == alone.to_dict() | {
            "cycles": level.found.to_dict()["cycles"]
        }
    assert (found.gain, found.loop_width) == (
        found.levels[0].found.gain,
        found.levels[0].found.loop_width,
    )
    assert (found.n_recordings, found.n_samples) == (6, 6 * TIME.size)
    assert [cycle.recording for cycle in found.cycles] == sorted(3 * list(range(6)))
    (effect,) = found.effects
    assert effect.channel == "displacement"
    assert effect.change == pytest.approx(-5 * 20 - 130 * 2.5, rel=0.1)
    assert found.sentences[3].startswith("Where displacement rests at 0 mm, force has a loop of")
    assert "; at 20 mm, a loop of" in found.sentences[3]
    assert found.sentences[-1].startswith("Told where displacement rests at 0 mm")
    rows = {name: value for name, value, _, _ in found.table()}
    assert rows["gain at 10 mm"] == found.levels[1].found.gain
    assert [level["held"]["displacement"] for level in found.to_dict()["levels"]] == [0, 10, 20]


def test_a_length_at_which_nothing_moves_hides_no_other() -> None:
    slack = isometric(30.0, 0.0, 0.0, 0)
    slack = slack.with_channels({"force": "N"}, force=np.zeros(TIME.size))
    found = characterize([isometric(*LENGTHS[0], 0), slack], output="force")
    assert found.has_loop
    assert [level.at for level in found.levels] == ["0 mm"]


def test_zeros_that_differ_under_one_load_are_no_effect_of_the_load() -> None:
    held = [loaded(np.full(TIME.size, load)) for load in (0.0, 300.0, 300.0)]
    zero = held[2].with_channels({"displacement": "mm"}, displacement=held[2]["displacement"] + 50)
    found = characterize([*held[:2], zero], beside=["force"])
    assert abs(found.effects[0].change) < 0.5  # what hangs at rest is zeroed, too
    assert found.output_range[1] == pytest.approx(held[0]["displacement"].max(), abs=4.0)
    assert "rest at different displacement" in found.sentences[-2]


def test_what_a_load_does_can_be_taken_away() -> None:
    swung = loaded(150 + 150 * np.sin(TIME))
    moved = effects([swung], "pressure", "displacement", ["force"])
    assert [effect.change for effect in moved] == pytest.approx([-6.0], rel=0.05)
    left = characterize(without([swung], "displacement", moved))
    clean = characterize(loaded(np.zeros(TIME.size)))
    assert left.loop_width == pytest.approx(clean.loop_width, rel=0.1)

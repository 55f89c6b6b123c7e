"""Plans keep to their limits, and never lose to random motion by their own measure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben import PI, Recording, load_rig
from mckibben.blocks.core.block import Block
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.errors import DataError, ModelError
from mckibben.excitation.believed import from_recordings
from mckibben.excitation.candidates import random_motion, stretches
from mckibben.excitation.information import Criterion, Noise, Slopes, covariance, standard_errors
from mckibben.excitation.limits import (
    Limit,
    followed,
    limits_of_recordings,
    limits_of_rig,
    narrowed,
    parsed,
)
from mckibben.excitation.planning import plan
from mckibben.excitation.plans import Plan
from mckibben.excitation.prospect import prospect_of
from mckibben.excitation.search import CANDIDATES, FEWEST, WORK, Search
from mckibben.excitation.unmodelled import Unmodelled

LIMITS = {"pressure": Limit(0.5, 4.0, 1.5, 0.5)}
STEP = 0.02


def run_of(block: Block, commands: Recording, seed: int, noise: float = 0.02) -> Recording:
    """Record a plant that is the model itself, and white noise."""
    found = block.simulate(commands)
    name = block.outputs[0].name
    rng = np.random.default_rng(seed)
    return found.with_channels(
        {name: found.units[name]}, **{name: found[name] + noise * rng.standard_normal(len(found))}
    )


def slow_sine(seconds: float, low: float = 0.5, high: float = 4.0) -> Recording:
    time = STEP * np.arange(round(seconds / STEP))
    wave = low + (high - low) * (0.5 - 0.5 * np.cos(2 * np.pi * time / seconds))
    return Recording({"pressure": wave}, STEP)


@pytest.fixture(scope="module")
def play() -> Block:
    return PI.example()


@pytest.fixture(scope="module")
def first(play: Block) -> Plan:
    small = run_of(play, slow_sine(8.0, 0.5, 1.2), 0)
    limits = {"pressure": (0.5, 4.0, 1.5)}
    return plan(small, model=play, minutes=0.75, limits=limits, seed=1)


def test_commands_keep_to_limits_and_come_home(first: Plan) -> None:
    pressure = first.recording["pressure"]
    assert pressure.min() >= 0.5 - 1e-12
    assert pressure.max() <= 4.0 + 1e-12
    step = first.recording.sample_time or 1.0
    assert np.abs(np.diff(pressure)).max() <= 1.5 * step * (1 + 1e-9)
    assert pressure[0] == pytest.approx(0.5, abs=0.1)
    assert pressure[-1] == pytest.approx(pressure[0], abs=1e-9)
    assert first.recording.duration == pytest.approx(45.0, rel=0.08)


def test_a_plan_is_never_worse_than_random_motion_by_its_own_measure(first: Plan) -> None:
    for name, (now, after) in first.errors.items():
        assert after < now
        assert after <= first.random[name] * (1 + 1e-9)


def test_errors_fall_and_steps_cover_the_time(first: Plan) -> None:
    assert all(one.after <= one.now * (1 + 1e-6) for one in first.parameters)
    ends = [one.stop for one in first.steps]
    assert [one.start for one in first.steps] == pytest.approx([0.0, *ends[:-1]])
    assert ends[-1] == pytest.approx(first.recording.duration, abs=0.1)
    assert first.steps[-1].why == "to end at rest"
    assert "instead of" in first.sentence
    assert first.to_dict()["seconds"] == first.recording.duration


def test_plans_are_the_same_for_the_same_seed(play: Block, first: Plan) -> None:
    small = run_of(play, slow_sine(8.0, 0.5, 1.2), 0)
    limits = {"pressure": (0.5, 4.0, 1.5)}
    again = plan(small, model=play, minutes=0.75, limits=limits, seed=1)
    assert again.recording == first.recording


def test_after_recording_it_less_is_expected_of_another(play: Block, first: Plan) -> None:
    small = run_of(play, slow_sine(8.0, 0.5, 1.2), 0)
    second_run = run_of(play, first.recording, 1)
    limits = {"pressure": (0.5, 4.0, 1.5)}
    then = plan([small, second_run], model=play, minutes=0.75, limits=limits, seed=1)
    assert then.errors["displacement"][0] < 0.5 * first.errors["displacement"][0]


def test_predicted_standard_errors_are_the_spread_of_estimates() -> None:
    """Least squares of a model of its own motion spreads as its slopes say (Gauss-Markov)."""
    block = PI.example()
    places = [0, 1, 2]
    values = block.pack()
    commands = followed(
        random_motion(600, STEP, 0.5, 4.0, 0.5, np.random.default_rng(3))[:, np.newaxis],
        np.array([0.5]),
        LIMITS,
        STEP,
    )
    own = Slopes(block, places, STEP, len(commands))
    base, slopes, _ = own.over(commands, own.start(commands[0]))
    noise, matrix = 0.05, slopes[:, 0, :]
    said = standard_errors(matrix.T @ matrix / noise**2)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(200):
        away = noise * rng.standard_normal(len(base))
        found.append(np.linalg.lstsq(matrix, away, rcond=None)[0])
    assert np.std(found, axis=0) == pytest.approx(said, rel=0.2)
    assert (values[places] != 0).all()


def test_slopes_in_parts_are_those_of_the_whole() -> None:
    block = PI.example()
    commands = random_motion(200, STEP, 0.5, 4.0, 0.5, np.random.default_rng(4))[:, np.newaxis]
    whole = Slopes(block, [0, 1], STEP, 200)
    parts = Slopes(block, [0, 1], STEP, 100)
    states = parts.start(commands[0])
    _, once, _ = whole.over(commands, whole.start(commands[0]))
    _, first_half, states = parts.over(commands[:100], states)
    _, second_half, _ = parts.over(commands[100:], states)
    assert np.array_equal(once, np.concatenate([first_half, second_half]))


def test_covariance_is_the_inverse() -> None:
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((20, 4)) * [1.0, 1e3, 1e-3, 1.0]
    precision = matrix.T @ matrix
    assert covariance(precision) == pytest.approx(np.linalg.inv(precision), rel=1e-6)


def test_a_goal_is_reached_better_than_by_motion_for_predictions() -> None:
    friction = MultistateFriction(("shared",), (20.0, 2.0, 40.0, 2.0, 30.0), initial="virgin")
    time = STEP * np.arange(1000)
    slow = 195.0 + np.interp(time, (0.0, 10.0, 20.0), (5.0, -5.0, 5.0))
    commands = Recording({"length": slow, "pressure": np.full(1000, 4.0)}, STEP)
    recorded = run_of(friction, commands, 0, noise=1.0)
    limits = {"length": (190.0, 200.0, 15.0)}
    chosen, general = (
        plan(recorded, model=friction, minutes=0.75, limits=limits, goal=goal)
        for goal in ("sigma", None)
    )
    assert len(chosen.learned) == 2

    def squares(one: Plan) -> float:
        return sum(p.after**2 for p in one.parameters if "sigma" in p.name)

    assert squares(chosen) <= squares(general)
    assert np.ptp(chosen.recording["pressure"]) == 0.0


def test_the_rig_plays_the_plan_without_a_limit_reached() -> None:
    rig = load_rig("soft-arm")
    limits = limits_of_rig(rig)
    rest = np.array([one.rest for one in limits.values()])
    made = stretches(rest, limits, 100, 0.05, 12, np.random.default_rng(0))
    for one in made:
        commands = followed(one.targets, rest, limits, 0.05)
        channels = dict(zip(limits, commands.T, strict=True))
        assert "saturated" not in rig.run(Recording(channels, 0.05)).meta
    assert {one.what.partition(" of ")[0] for one in made} >= {"hold", "loops", "steps"}


def test_what_is_driven_is_known_from_recordings() -> None:
    found = limits_of_recordings([slow_sine(8.0)], ["pressure"])["pressure"]
    assert (found.low, found.high) == pytest.approx((0.5, 4.0), abs=1e-3)
    assert found.rate == pytest.approx(3.5 * np.pi / 8.0, rel=0.02)


def test_a_wrong_model_is_pulled_as_least_squares_pulls_it() -> None:
    """The expected bias is the mean square of misfits of fits to random functions (Monte Carlo)."""
    block, rng = PI.example(), np.random.default_rng(5)
    unmodelled = Unmodelled.of(np.array([0.5]), np.array([4.0]), np.array([1.5]), rng)
    slopes = Slopes(block, [0, 1, 2], STEP, 800)
    start = np.array([0.5])

    def motion(low: float, high: float) -> np.ndarray:
        path = random_motion(800, STEP, low, high, 0.5, rng)[:, np.newaxis]
        return followed(path, start, LIMITS, STEP)

    wide, narrow = motion(0.5, 4.0), motion(0.5, 1.5)
    spans = np.array([2.0])
    noise = Noise(np.array([1e-6]), 0.02)
    criterion = Criterion((slopes,), unmodelled, noise, STEP, spans, np.array([0]))
    criterion = criterion.weighed_by([wide], criterion.start(start))
    matrix, known = {}, {}
    for name, commands in (("wide", wide), ("narrow", narrow)):
        told, _ = criterion.over(commands, criterion.start(start))
        known[name] = criterion.errors(told)[1]
        _, own, _ = slopes.over(commands, slopes.start(start))
        features, _ = unmodelled.features(commands, unmodelled.start(start), STEP)
        matrix[name] = own[:, 0, :] / spans, noise.left * features
    aim, left = matrix["wide"]
    for name, (own, pulled) in matrix.items():
        aside = np.linalg.lstsq(own, pulled, rcond=None)[0]
        drawn = rng.standard_normal((left.shape[1], 2000))
        misfit = np.mean(((left - aim @ aside) @ drawn) ** 2)
        assert known[name] == pytest.approx(misfit, rel=0.1)
    assert known["narrow"] > known["wide"]


def test_the_work_of_a_search_does_not_grow_with_the_time() -> None:
    recorded = run_of(PI.example(), slow_sine(8.0), 0)
    belief = from_recordings([recorded], PI.example(), None, 0)
    within = narrowed(belief.limits, {"pressure": (0.5, 4.0, 1.5)})
    search = Search(prospect_of(belief, within, 60.0, None, 0), 0, None)
    search.spent = round(0.9 * WORK)
    assert search.affordable(20) == FEWEST
    search.spent = round(1e-4 * WORK)
    assert search.affordable(20) == CANDIDATES


def test_what_came_before_a_recording_is_no_noise_of_its_model() -> None:
    recorded = run_of(PI.example(), slow_sine(40.0), 0)
    fading = 1.5 * np.exp(-recorded.time)
    moved = recorded.with_channels(
        {"displacement": "mm"}, displacement=recorded["displacement"] + fading
    )
    found = []
    for one in (recorded, moved):
        belief = from_recordings([one], PI.example(), None, 0)
        prospect = prospect_of(belief, belief.limits, 60.0, None, 0)
        found.append((prospect.motion.noise.density[0], prospect.by_motion(prospect.known)))
    assert found[1] == pytest.approx(found[0], rel=0.3)


def test_models_without_anything_to_tell_are_refused() -> None:
    silent = PI.example()
    silent = silent.unpack(np.zeros_like(silent.pack()))
    recorded = run_of(PI.example(), slow_sine(8.0), 0)
    with pytest.raises(ModelError, match=r"no parameters that .* Remedy: plan with"):
        plan(recorded, model=silent, minutes=1.0)


def test_features_remember_over_parts() -> None:
    known = Unmodelled.of(
        np.array([0.0]), np.array([4.0]), np.array([2.0]), np.random.default_rng(0)
    )
    commands = random_motion(200, STEP, 0.0, 4.0, 0.5, np.random.default_rng(1))[:, np.newaxis]
    start = known.start(commands[0])
    whole, _ = known.features(commands, start, STEP)
    first_half, memory = known.features(commands[:100], start, STEP)
    second_half, _ = known.features(commands[100:], memory, STEP)
    assert np.concatenate([first_half, second_half]) == pytest.approx(whole, abs=1e-12)


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"limits": {"pressure": (4.0, 1.0)}}, "not in order"),
        ({"limits": {"pressure": (0.5, 4.0, 0.01)}}, "from end to end"),
        ({"limits": {"pressure": (0.5, 4.0, 0.0)}}, "positive rate"),
        ({"limits": {"pressure": (2.0, 2.0)}}, "may move"),
        ({"limits": {"force": (0.0, 2.0)}}, "not driven"),
        ({"minutes": 0.01}, "--minutes"),
        ({"minutes": float("nan")}, "impossible"),
        ({"goal": "nonsense"}, "nonsense"),
        ({"goal": ""}, "Remedy"),
        ({"rig": "rail"}, "lacks voltage"),
        ({"muscle": "rail"}, "--muscle"),
    ],
)
def test_the_impossible_is_refused_in_words(play: Block, how: dict[str, object], said: str) -> None:
    recorded = run_of(play, slow_sine(8.0), 0)
    with pytest.raises((DataError, ModelError), match=said) as caught:
        plan(recorded, model=play, **{"minutes": 1.0} | how)  # type: ignore[arg-type]
    assert "Remedy" in str(caught.value)


def test_recordings_without_time_and_rigs_beyond_their_range_are_refused(play: Block) -> None:
    timeless = replace(run_of(play, slow_sine(8.0), 0), sample_time=None)
    with pytest.raises(DataError, match="--rate"):
        plan(timeless, model=play, minutes=1.0)
    with pytest.raises(DataError, match="beyond"):
        plan(rig="mas20-hanging", limits={"pressure": (0.0, 30.0)})
    with pytest.raises(DataError, match="a plan is from"):
        plan()


def test_limits_are_read_and_narrowed() -> None:
    assert parsed(["a=1:2", "b=::3"]) == {"a": [1.0, 2.0], "b": [None, None, 3.0]}
    for text in ("a", "a=1", "a=1:2:3:4", "a=x:1", "=1:2"):
        with pytest.raises(DataError, match="CHANNEL=LOW:HIGH"):
            parsed([text])
    found = narrowed(LIMITS, {"pressure": [1.0, None]})["pressure"]
    assert found == Limit(1.0, 4.0, 1.5, 1.0)

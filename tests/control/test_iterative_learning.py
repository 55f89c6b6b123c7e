"""Iterative learning: on plants simple enough to know how fast it converges."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mckibben import PI, Affine, Block, DataError, ModelError, Recording, Series, load, write
from mckibben.arrays import Array
from mckibben.blocks.fields import Channel
from mckibben.blocks.repetition import Repetition
from mckibben.control import Twin, learn, learned
from mckibben.workflow import learn as from_files
from mckibben.workflow import track
from tests.refusals import refused

STEP, N = 0.02, 1000
DISPLACEMENT, PRESSURE = Channel("displacement", "mm"), Channel("pressure", "bar")
EXACT = Affine(0.25, 0.0, DISPLACEMENT, PRESSURE)
"""The inverse of a plant of 4 mm/bar."""

UNITS = {"reference_displacement": "mm"}

TIME = STEP * np.arange(N)
MOTION = 8.0 + 5.0 * np.sin(2 * np.pi * 0.2 * TIME) + np.sin(2 * np.pi * 0.55 * TIME + 1.0)


def runner(plant: Callable[[Array], Array], noise: float = 0.0) -> Callable[[Block], Recording]:
    """Return a loop without feedback on a plant from pressures to displacements."""
    rng = np.random.default_rng(0)

    def run(compensator: Block) -> Recording:
        pressure = compensator.simulate(MOTION[:, None], sample_time=STEP)[:, 0]
        seen = plant(pressure) + noise * rng.standard_normal(N)
        return Recording({"reference_displacement": MOTION, "displacement": seen}, STEP, UNITS)

    return run


def late(pressure: Array, delay: int) -> Array:
    return np.concatenate([np.repeat(pressure[:1], delay), pressure[: N - delay]])


def test_behind_an_exact_inverse_an_offset_is_learned_at_once() -> None:
    found = learn(EXACT, runner(lambda p: 4.0 * p - 0.7), 1)
    first, second = found.rmse["displacement"]
    assert first == pytest.approx(0.7)
    assert second < 1e-12
    assert found.best_repetition == 1


def test_a_gain_error_and_dead_time_contract_as_expected() -> None:
    found = learn(EXACT, runner(lambda p: 4.0 * 0.7 * late(p, 5)), 5)
    errors = found.rmse["displacement"]
    assert found.expected["displacement"] == pytest.approx(0.3, abs=0.05)
    # |1 - T| is 0.3; the beginning and the end are not those of a motion that goes on
    assert np.array(errors[1:4]) == pytest.approx(0.3 * np.array(errors[:3]), rel=0.25)
    assert errors[-1] < 0.02 * errors[0]
    assert found.convergence["displacement"] < 0.5


@pytest.mark.parametrize("gain", [0.7, 1.3, 1.7])
def test_it_ends_near_the_noise(gain: float) -> None:
    noise = 0.05
    found = learn(EXACT, runner(lambda p: 4.0 * gain * p, noise))
    again = runner(lambda p: 4.0 * gain * p)(found.best)
    true = np.sqrt(np.mean((again["displacement"] - MOTION) ** 2))
    assert true < noise
    assert found.rmse["displacement"][found.best_repetition] < 1.5 * noise


def test_it_never_delivers_worse_than_the_compensator() -> None:
    found = learn(EXACT, runner(lambda p: 20.0 - 4.0 * p), 4)  # which goes the other way
    errors = found.rmse["displacement"]
    assert min(errors[1:]) > errors[0]
    assert found.best is EXACT
    unlearned = learned(EXACT, [found.runs[0]])
    assert unlearned.best is EXACT


def test_corrections_are_not_taken_for_faults() -> None:
    model = PI.example()
    low, high = model.inverse().input_bounds[0]
    desired = 0.5 * (low + high) + 0.4 * (high - low) * np.sin(2 * np.pi * 0.2 * TIME)
    seen = np.zeros(N)
    run = Recording({"reference_displacement": desired, "displacement": seen}, STEP, UNITS)
    found = learned(model.inverse(), [run] * 6).next
    assert isinstance(found, Series)
    assert isinstance(found.parts[0], Repetition)
    corrected = desired + np.array(found.parts[0].corrections[0])
    assert corrected.max() == pytest.approx(high)


def test_a_motion_without_pause_is_learned_around_its_ends() -> None:
    """The state of a repetition is that left by the one before."""
    memory = PI((0.0, 1.0), (3.0, 1.0), 0.0, (-50.0, 50.0))
    state: list[float] = memory.initial_state(np.zeros(1)).tolist()
    desired = 8.0 - 6.0 * np.cos(2 * np.pi * 4 * np.arange(N) / N)

    def run(compensator: Block) -> Recording:
        nonlocal state
        pressure = compensator.simulate(desired[:, None], sample_time=STEP)
        stream = memory.stream(initial=state)
        seen = np.array([stream.step(row)[0] for row in pressure])
        state = stream.state.tolist()
        return Recording({"reference_displacement": desired, "displacement": seen}, STEP, UNITS)

    found = learn(EXACT, run, repeats=True)
    errors = found.rmse["displacement"]
    assert min(errors) < 0.05 * errors[0]
    table = found.best.parts[0]  # type: ignore[attr-defined]
    twice = table.simulate(np.zeros((2 * N, 1)), sample_time=STEP)[:, 0]
    np.testing.assert_array_equal(twice[:N], twice[N:])


def test_recordings_that_are_no_repetitions_are_refused() -> None:
    run = runner(lambda p: 4.0 * p)(EXACT)
    other = run.with_channels(reference_displacement=MOTION + 1.0)
    for runs in ([], [run, other], [run, run.slice(0, N // 2)], [run.select(["displacement"])]):
        with pytest.raises(DataError):
            learned(EXACT, runs)
    with refused(ModelError, parameter="repetitions"):
        learn(EXACT, lambda block: run, 0)
    with refused(ModelError, parameter="ahead"):
        learned(EXACT, [run], ahead=N)


def test_track_learns_on_a_twin_and_delivers_what_it_measured(tmp_path: Path) -> None:
    model = PI.example()
    low, high = (float(end[0]) for end in model.reachable())
    desired = 0.5 * (low + high) + 0.3 * (high - low) * np.sin(2 * np.pi * 0.2 * TIME)
    moved = model.output
    plant = Twin(Series((model, Affine(0.8, 0.4, moved, moved))), sample_time=STEP)
    found = track(
        model.inverse(),
        Recording({"displacement": desired}, STEP),
        plant=plant,
        repetitions=6,
        approach=2.0,
        noise=0.01,
        pressure_loop=False,
        controller_out=tmp_path / "learned.json",
    )
    assert found.learned is not None
    errors = found.learned.rmse["displacement"]
    assert len(errors) == 7
    assert min(errors) < 0.1 * errors[0]
    assert found.tracked.rmse["displacement"] == pytest.approx(min(errors), rel=0.2)
    assert load(tmp_path / "learned.json") == found.learned.best
    assert found.to_dict()["learned"]["best_repetition"] == found.learned.best_repetition


def test_what_is_written_for_the_next_repetition_is_what_a_loop_would_run(tmp_path: Path) -> None:
    run = runner(lambda p: 3.0 * p + 0.5)
    EXACT.save(tmp_path / "compensator.json")
    block: Block = EXACT
    files: list[Path] = []
    for k in range(3):
        files.append(tmp_path / f"run{k}.csv")
        write(run(block), files[-1])
        found = from_files(
            tmp_path / "compensator.json", files, out=tmp_path / "next.json", force=True
        )
        block = load(tmp_path / "next.json")
        assert block == found.next
    errors = found.rmse["displacement"]
    assert errors[-1] < 0.2 * errors[0]
    looped = learn(EXACT, run, 2).rmse["displacement"]
    assert np.array(errors) == pytest.approx(np.array(looped), rel=1e-6)

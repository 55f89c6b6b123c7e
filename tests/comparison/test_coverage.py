"""Where training has been, and how models of local rules do elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import Recording, compare
from mckibben.comparison.coverage import FARTHEST, NEAREST, OffTraining, coverage_of
from mckibben.comparison.results import Leaderboard

INPUTS = ("pressure_1", "pressure_2")
TIME = np.arange(0, 30, 0.1)


def moved(*pressures: np.ndarray) -> Recording:
    """Return a recording of displacements with a product, which is learned where both move alone."""
    one, two = pressures
    given = dict(zip(INPUTS, pressures, strict=True))
    made = {"displacement_1": 5 * one + one * two, "displacement_2": 4 * two - one * two}
    return Recording(given | made, 0.1)


def wave(seed: float, peak: float = 3.0) -> np.ndarray:
    return peak * 0.5 * (1 - np.cos(2 * np.pi * (0.07 + 0.02 * seed) * TIME + seed))


STILL = np.zeros(TIME.size)
PATTERNS = [
    moved(wave(0), STILL),
    moved(wave(1), STILL),
    moved(STILL, wave(0)),
    moved(STILL, wave(1)),
]
JOINT = [moved(wave(k), wave(2.3 * k + 0.7)) for k in range(1, 9)]
TOGETHER = moved(wave(0.4), wave(3.1))


def test_muscles_moved_one_at_a_time_cover_edges_alone() -> None:
    apart = coverage_of(PATTERNS, [TOGETHER], INPUTS)
    joint = coverage_of(JOINT, [TOGETHER], INPUTS)
    assert apart is not None
    assert joint is not None
    assert (apart.n_patterns, joint.n_patterns) == (2, None)
    assert apart.trained == "2 patterns"
    assert joint.trained == "8 runs"
    assert apart.covered < 0.3 < 0.9 < joint.covered
    assert apart.outside[0].mean() > 0.5
    assert joint.outside[0].mean() < 0.05


def test_distances_are_those_to_the_nearest_sample_and_the_radius_that_between_runs() -> None:
    """Against all pairs of samples, one by one."""
    few = JOINT[:3]
    found = coverage_of(few, [TOGETHER], INPUTS)
    assert found is not None
    low = np.min([r.matrix(INPUTS).min(axis=0) for r in few], axis=0)
    span = np.max([r.matrix(INPUTS).max(axis=0) for r in few], axis=0) - low
    runs = [(r.matrix(INPUTS) - low) / span for r in few]

    def nearest(x: np.ndarray, others: list[np.ndarray]) -> float:
        return min(float(np.sqrt(((x - run) ** 2).sum(axis=1)).min()) for run in others)

    apart = [nearest(x, runs[:k] + runs[k + 1 :]) for k, run in enumerate(runs) for x in run]
    assert NEAREST < found.radius < FARTHEST
    assert found.radius == pytest.approx(np.quantile(apart, 0.99), rel=1e-9)
    asked = (TOGETHER.matrix(INPUTS) - low) / span
    expected = [nearest(x, runs) > found.radius for x in asked]
    np.testing.assert_array_equal(found.outside[0], expected)


@given(st.floats(0.01, 100.0), st.floats(-50.0, 50.0))
def test_units_and_offsets_do_not_matter(scale: float, offset: float) -> None:
    def other(run: Recording) -> Recording:
        return run.with_channels(pressure_1=scale * run["pressure_1"] + offset)

    known = coverage_of(PATTERNS, [TOGETHER], INPUTS)
    found = coverage_of([other(run) for run in PATTERNS], [other(TOGETHER)], INPUTS)
    if found is None:  # so far from 0 that it hardly moves
        assert 3 * scale <= 0.011 * (3 * scale + abs(offset))
        return
    assert known is not None
    assert found.radius == pytest.approx(known.radius, rel=1e-6)
    assert found.covered == pytest.approx(known.covered, abs=0.01)
    assert np.mean(found.outside[0] != known.outside[0]) < 0.01


def test_what_training_holds_and_the_test_moves_is_outside() -> None:
    held = [run.with_channels(pressure_extensor=np.full(len(run), 1.0)) for run in JOINT]
    stiff = TOGETHER.with_channels(pressure_extensor=np.full(len(TOGETHER), 2.0))
    same = TOGETHER.with_channels(pressure_extensor=np.full(len(TOGETHER), 1.0))
    found = coverage_of(held, [same, stiff], (*INPUTS, "pressure_extensor"))
    assert found is not None
    assert found.outside[0].mean() < 0.05
    assert found.outside[1].all()
    assert found.covered > 0.9


def test_one_input_or_one_run_alone() -> None:
    assert coverage_of(JOINT, [TOGETHER], INPUTS[:1]) is None
    assert coverage_of(PATTERNS[:2], [TOGETHER], INPUTS) is None
    found = coverage_of(JOINT[:1], JOINT[:1], INPUTS)
    assert found is not None
    assert not found.outside[0].any()
    assert found.trained == "1 run"


def test_errors_inside_and_outside_are_told_apart() -> None:
    found = coverage_of(PATTERNS, [TOGETHER], INPUTS)
    assert found is not None
    far = found.outside[0]
    errors = np.where(far, 6.0, 2.0)[:, np.newaxis] * np.ones(2)
    told = found.of(errors, [np.ones(TIME.size, dtype=bool)], 4.0, "mm")
    assert told.share == pytest.approx(far.mean())
    assert (told.inside, told.outside, told.ratio) == pytest.approx((2.0, 6.0, 3.0))
    assert told.ratio_to_fitted == pytest.approx(1.5)
    assert told.trusted is False
    alone = found.of(errors[far], [far])
    assert (alone.share, alone.inside, alone.ratio, alone.trusted) == (1.0, None, None, None)


@pytest.mark.parametrize(
    ("given", "trusted", "said"),
    [
        (OffTraining("4 patterns", 0.1, 0.8, 1.0, 9.0), False, "9.0 times its error inside (1.00)"),
        (OffTraining("4 patterns", 0.1, 0.8, 1.0, 1.2, 1.1), True, "it holds there too"),
        (
            OffTraining("4 patterns", 0.1, 0.8, 1.0, 1.2, 0.1),
            False,
            "12 times its error on the data fitted",
        ),
        (OffTraining("4 patterns", 0.1, 0.0, 1.0, None), None, "nothing here tells"),
        (OffTraining("1 run", 0.9, 0.0, 1.0, None), True, "1 run that covers 90 %"),
        (OffTraining("9 runs", 0.9, 0.001, 1.0, None), True, "0.10 % of the test samples"),
        (OffTraining("9 runs", 0.2, 1.0, None, 7.0, None, "mm"), None, "off by 7.00 mm RMSE"),
    ],
)
def test_what_is_said_follows_from_the_figures(
    given: OffTraining, trusted: bool | None, said: str
) -> None:
    assert given.trusted is trusted
    assert said in str(given)


def board(train: list[Recording], test: Recording) -> Leaderboard:
    settings = {"tsfnn": {"n_sets": 2, "search_samples": 300}}
    models = ["tsfnn", "coupled-memory"]
    return compare(train, test, models=models, settings=settings, n_folds=0, jobs=1)


def test_a_network_is_not_to_be_trusted_where_no_run_moved_both_muscles() -> None:
    found = board(PATTERNS, TOGETHER)
    rows = {row.model: row for row in found.rows}
    told = rows["tsfnn"].off_training
    assert told is not None
    assert told.trusted is False
    assert told.ratio is not None
    assert told.ratio > 2
    assert rows["coupled-memory"].off_training is None
    (sentence,) = found.off_training
    assert sentence.startswith("tsfnn: trained on 2 patterns that cover ")
    assert sentence in found.to_dict()["notes"]
    (row,) = [row for row in found.to_dict()["rows"] if row["model"] == "tsfnn"]
    assert row["off_training"]["trusted"] is False


def test_a_network_is_to_be_trusted_where_training_covers_the_test() -> None:
    (told,) = [row.off_training for row in board(JOINT, TOGETHER).rows if row.model == "tsfnn"]
    assert told is not None
    assert told.covered > 0.9
    assert told.trusted
    assert told.inside is not None
    assert told.inside < 0.5


def test_the_test_has_no_say_in_the_order() -> None:
    """Rows and models are the same, whatever is tested on."""
    first, second = board(PATTERNS, TOGETHER), board(PATTERNS, moved(wave(5), wave(6)))
    assert [row.model for row in first.rows] == [row.model for row in second.rows]
    for one, other in zip(first.rows, second.rows, strict=True):
        assert one.block == other.block

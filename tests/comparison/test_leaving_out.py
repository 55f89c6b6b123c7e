"""Parts that are left out in turn, and the model as it would be without one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mckibben import GPI, Recording, compare
from mckibben.arrays import Array
from mckibben.channels import Channels, channels_of
from mckibben.comparison.leaderboard import CAUTION, Row, doubts_of
from mckibben.estimators.core.estimator import Estimator
from mckibben.estimators.core.leaving_out import MOST_FREE
from mckibben.metrics import Scores
from mckibben.numerics.tracker import Tracker
from mckibben.registry import load
from mckibben.signals import irregular_triangle, triangle
from mckibben.splits import N_PARTS, Span, parts_of, spans_of

CHANNELS = Channels(("pressure",), ("displacement",))
STEP = 0.02
TIME = np.arange(0, 24, STEP)


def recorded(u: Array, seed: int = 0, **others: Array) -> Recording:
    noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    channels = {"pressure": u, "displacement": GPI.example().simulate(u) + noise}
    return Recording(channels | others, STEP, meta={"name": f"run {seed}"})


RUN = recorded(irregular_triangle(TIME, 20, 5.0, seed=3))


# -- parts -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 3, 5, 7])
def test_of_few_recordings_parts_are_blocks_of_time(count: int) -> None:
    runs = [recorded(triangle(TIME, 4.0, 5.0), seed) for seed in range(count)]
    parts = parts_of(runs, CHANNELS)
    assert N_PARTS <= len(parts) < N_PARTS + count
    for place, run in enumerate(runs):
        np.testing.assert_array_equal(np.sum([part[place] for part in parts], axis=0), 1)
        assert np.ptp([part[place].sum() for part in parts if part[place].any()]) <= 1
        assert [len(spans_of(part, runs)) for part in parts] == [1] * len(parts)
        assert sum(run.name == one.recording for part in parts for one in spans_of(part, runs)) > 1


def test_levels_and_repeats_are_spread_over_the_parts() -> None:
    wave = triangle(TIME, 4.0, 5.0)
    loads = [100.0, 200.0, 300.0, 400.0] * 4
    runs = [recorded(wave, k, force=np.full(wave.size, x)) for k, x in enumerate(loads)]
    parts = parts_of(runs, channels_of(runs))
    assert len(parts) == N_PARTS
    for part in parts:
        inside = [load for load, rows in zip(loads, part, strict=True) if rows.all()]
        assert len(inside) == len(set(inside)) == 2


def test_bridged_samples_and_short_recordings_are_left_alone() -> None:
    bridged = RUN.with_meta(bridged=[[1.0, 2.0]])
    rows = np.sum([part[0] for part in parts_of([bridged], CHANNELS)], axis=0)
    np.testing.assert_array_equal(rows, ~bridged.bridged)
    assert parts_of([RUN.slice(0, 15)], CHANNELS) == ()


# -- the model without a part ----------------------------------------------------------------------


def without(estimator: Estimator, part: Any) -> Array:
    """Return the outputs of a fit, from rest, to all but a part."""
    model = estimator.find(estimator.data([RUN], [~part[0]]), Tracker())
    return model.simulate(RUN, initial="first_sample")["displacement"]


def test_of_a_linear_readout_it_is_that_of_a_fit_to_the_rest() -> None:
    parts = parts_of([RUN], CHANNELS)
    whole = load("estimators", "play-ridge")(ridge=1e-3).fit(RUN)
    runs = whole.free_runs(whole.model_, [RUN]).from_rest
    found = whole.left_out(runs, [part[0] for part in parts])
    for part, (table,) in list(zip(parts, found, strict=True))[:-1]:  # a fit ends with what counts
        again = without(load("estimators", "play-ridge")(ridge=1e-3), part)
        np.testing.assert_allclose(table[:, 0], again, atol=1e-6)


@pytest.mark.parametrize("name", ["p1", "oe", "mpi", "maxwell-slip", "bouc-wen"])
def test_the_error_on_a_part_is_about_that_of_a_fit_to_the_rest(name: str) -> None:
    parts = parts_of([RUN], CHANNELS)
    estimator = load("estimators", name)().fit(RUN)
    (table,) = estimator.held_out([RUN], parts) or []
    errors = []
    for part in parts[2:5]:
        rows, y = part[0], RUN["displacement"]
        again = without(load("estimators", name)(), part)
        of_both = [table[rows, 0] - y[rows], again[rows] - y[rows]]
        errors.append([np.sqrt(np.mean(error**2)) for error in of_both])
    stepped, refitted = np.exp(np.log(errors).mean(axis=0))
    assert 0.7 < stepped / refitted < 1.4


def test_the_part_itself_has_no_say() -> None:
    """However wrong the outputs of a part are, the model without it fits the rest."""
    part = parts_of([RUN], CHANNELS)[4]
    y = RUN["displacement"] + np.where(part[0], 3.0, 0.0)
    spoilt = RUN.with_channels(displacement=y)
    estimator = load("estimators", "mpi")().fit(spoilt)
    (table,) = estimator.held_out([spoilt], [part]) or []
    error = (table[:, 0] - RUN["displacement"])[part[0]]
    fitted = (estimator.model_.simulate(spoilt)["displacement"] - RUN["displacement"])[part[0]]
    assert np.sqrt(np.mean(error**2)) < 0.5 * np.sqrt(np.mean(fitted**2))


def test_a_model_with_too_many_parameters_is_judged_by_its_fit_and_doubted() -> None:
    board = compare(
        RUN,
        recorded(irregular_triangle(TIME, 12, 5.0, seed=5), 1),
        models={"large": "narx-network", "small": "pi"},
        settings={"large": {"n_units": MOST_FREE // 4, "max_evaluations": 3}},
        jobs=1,
    )
    rows = {row.model: row for row in board.rows}
    assert (rows["large"].validated, rows["small"].validated) == ("fit", "step")
    assert rows["large"].doubted
    assert rows["large"].order[2] == pytest.approx(CAUTION * rows["large"].chosen_by)


# -- doubts ----------------------------------------------------------------------------------------


def row(model: str, parts: list[float], test: float, beyond: bool = False) -> Row:
    scores = Scores(test, test, 1.0, test, 0.1, 1.0)
    return Row(
        model,
        train=scores,
        test=scores,
        validation_rmse=float(np.exp(np.log(parts).mean())),
        validation_by_part=tuple(parts),
        difference_interval=(-0.5, -0.1) if beyond else (0.1, 0.5),
        block=GPI.example(),
    )


SPANS = tuple((Span("run", float(k), k + 1.0, "s"),) for k in range(8))


def test_a_clear_choice_is_not_doubted() -> None:
    best, other = row("a", [1.0] * 8, 1.0), row("b", [2.0, 2.1] * 4, 2.0)
    assert doubts_of(best, [other], SPANS) == ()


def test_what_is_doubtful_is_named_with_its_data() -> None:
    bad = row("a", [0.1] * 7 + [2.0], 1.0)
    level = row("b", [0.1] * 6 + [0.3, 1.9], 0.5, beyond=True)
    test, part, second = doubts_of(bad, [level], SPANS)
    assert (test.kind, test.model, test.ratio) == ("test", "b", 2.0)
    assert (part.kind, part.model, part.spans) == ("part", "a", SPANS[7])
    assert part.ratio == pytest.approx(2.0 / bad.chosen_by)
    assert (second.kind, second.model, second.spans) == ("level", "b", SPANS[6])
    assert second.interval is not None
    assert second.interval[0] <= 1 <= second.interval[1]

"""Data gaps: nothing where nothing is missing, and what is missing where one excitation is left out."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mckibben import DataError, Recording
from mckibben.diagnosis.data_gaps import RULES, data_gaps
from mckibben.report.words import gap_run, gap_sentence
from tests.diagnosis.lacking import Recorder, lacking
from tests.plants import PLANTS
from tests.refusals import refused


@pytest.mark.parametrize("plant", ["lugre_muscle", "antagonistic_joint", "lifter"])
def test_what_is_left_out_is_named_and_nothing_of_complete_recordings(plant: str) -> None:
    bench = PLANTS[plant](0).bench
    for name, gap, runs, tests in lacking(plant, 0):
        found = {
            one.what: one for one in data_gaps(runs, bench.pressures, bench.outputs, tests=tests)
        }
        assert gap in found if gap else not found, f"{name}: {list(found)}"
        if gap:
            rule = next(rule for rule in RULES if rule.what == gap)
            assert rule.beyond(found[gap].value, found[gap].needed)
            assert set(found[gap].ranges) == set(found[gap].channels)


@pytest.fixture(scope="module")
def lifted() -> Recorder:
    return Recorder("lifter", 1)


def named(runs: list[Recording], **given: Any) -> list[str]:
    return [gap.what for gap in data_gaps(runs, **given)]


def test_a_load_that_follows_the_output_is_a_spring(lifted: Recorder) -> None:
    runs = [one.with_channels(force=3 * one["displacement"]) for one in lifted.complete()]
    assert "spring load" in named(runs)


def test_tests_beyond_the_loads_recorded_are_named(lifted: Recorder) -> None:
    runs = lifted.complete()
    heavier = runs[0].with_channels(force=1.3 * runs[0]["force"])
    assert named(runs[1:], tests=runs[:1]) == []
    gaps = data_gaps(runs, tests=[heavier])
    assert [(gap.what, gap.channels) for gap in gaps] == [("range", ("force",))]


def test_levels_at_random_are_motion_not_noise() -> None:
    levels = np.random.default_rng(0).uniform(0.3, 4.0, 200)
    run = Recording({"pressure": levels, "displacement": 7.5 * levels}, 4.0)
    assert "creep" in named([run])


@pytest.mark.parametrize("name", ["pressure", "displacement"])
def test_what_does_not_move_identifies_nothing(lifted: Recorder, name: str) -> None:
    runs = [one.with_channels(**{name: np.ones(len(one))}) for one in lifted.complete()]
    gaps = data_gaps(runs, "pressure", "displacement")
    assert gaps[0].what in ("still", "resting")
    assert gaps[0].channels == (name,)
    assert [gap.severity for gap in gaps] == sorted((g.severity for g in gaps), reverse=True)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_units_do_not_matter(lifted: Recorder, scale: float) -> None:
    runs = [lifted.record(lifted.moving()), lifted.record(0.9 * lifted.moving())]
    scaled = [one.with_channels(displacement=scale * one["displacement"]) for one in runs]
    found = [[(gap.what, gap.value) for gap in data_gaps(r)] for r in (runs, scaled)]
    assert found[0] == found[1]


def test_gaps_are_json_and_every_rule_has_its_sentence(lifted: Recorder) -> None:
    gaps = data_gaps([lifted.record(lifted.cycles(6.0, 1.0)[:, np.newaxis] * np.ones(2))])
    assert json.loads(json.dumps([gap.to_dict() for gap in gaps]))[0]["what"] == gaps[0].what
    for rule in RULES:
        gap = type(gaps[0])(
            rule.what, 0.25, rule.needed, ("pressure",), {"pressure": (0.0, 4.0)}, rule.run, 0.5
        )
        assert any(text in gap_sentence(gap) for text in ("pressure", "0.25", "25 %"))
        assert "{" not in gap_sentence(gap) + gap_run(gap)


@pytest.mark.parametrize(
    ("given", "names", "fields"),
    [
        (lambda one: [], [], {"parameter": "recordings"}),
        (lambda one: [one], ["voltage"], {"channel": "voltage"}),
        (lambda one: [one, one.select(["pressure"])], [], {"channel": "displacement"}),
        (lambda one: one.slice(0, 9), [], {"names": (9, 10)}),
    ],
)
def test_recordings_that_cannot_be_judged_are_refused(
    lifted: Recorder, given: Callable[[Recording], Any], names: list[str], fields: dict[str, Any]
) -> None:
    with refused(DataError, **fields):
        data_gaps(given(lifted.record(lifted.held())), *names)

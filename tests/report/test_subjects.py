from __future__ import annotations

import numpy as np
import pytest

from mckibben.recording import Recording
from mckibben.report import subjects
from tests.report.studies_by_hand import measured


def test_the_loop_of_one_recording_is_coloured_by_age_without_gaps() -> None:
    recording = measured(500)
    (panel,) = subjects.loop([recording], "pressure", "displacement").panels
    assert [curve.colour for curve in panel.curves] == [f"age-{k}" for k in range(1, 6)]
    for before, after in zip(panel.curves, panel.curves[1:], strict=False):
        assert (before.x[-1], before.y[-1]) == (after.x[0], after.y[0])
    drawn = np.concatenate([panel.curves[0].x, *(curve.x[1:] for curve in panel.curves[1:])])
    np.testing.assert_array_equal(drawn, recording["pressure"])


def test_the_shortest_recording_has_a_loop() -> None:
    recording = measured(500).slice(0, 2)
    (panel,) = subjects.loop([recording], "pressure", "displacement").panels
    assert [curve.x.size for curve in panel.curves] == [2]


def test_several_recordings_share_panels_and_the_seventh_is_named() -> None:
    recordings = [measured(100, seed=k, name=f"run {k}") for k in range(8)]
    for drawing in (
        subjects.loop(recordings, "pressure", "displacement"),
        subjects.time_course(recordings, ("pressure", "displacement")),
    ):
        curves = drawing.panels[0].curves
        assert [curve.name for curve in curves] == [f"run {k}" for k in range(6)]
        assert drawing.note == "Not shown: run 6, run 7."


def test_arrows_follow_time_on_both_branches() -> None:
    u = np.concatenate([np.linspace(0, 5, 100), np.linspace(5, 0, 100)])
    up, down = subjects.directions(u, 2 * u)
    assert up.tail[0] < up.head[0]
    assert down.tail[0] > down.head[0]
    assert 2 < up.tail[0] < 3


def test_residuals_are_measured_less_modelled() -> None:
    recording = measured(200)
    outputs = {"gpi": recording["displacement"] - 0.5}
    against_input, against_time = subjects.residuals(
        recording, "pressure", "displacement", outputs, test_from=150
    ).panels
    np.testing.assert_allclose(against_input.curves[0].y, 0.5)
    np.testing.assert_allclose(against_time.curves[0].y, 0.5)
    assert against_time.marks[0].x == pytest.approx(1.5)


def test_the_best_model_lies_on_top() -> None:
    recording = measured(100)
    outputs = dict.fromkeys(("best", "second", "third"), recording["displacement"])
    for drawing in (
        subjects.fit_over_time(recording, "displacement", outputs),
        subjects.fit_loops(recording, "pressure", "displacement", outputs),
    ):
        names = [curve.name for curve in drawing.panels[0].curves]
        assert names == ["measured", "third", "second", "best"]


def test_what_a_virtual_rig_gave_is_not_called_measured() -> None:
    virtual = measured(100).with_meta(rig="mas20-hanging v2 (virtual)")
    outputs = {"best": virtual["displacement"]}
    drawing = subjects.fit_loops(virtual, "pressure", "displacement", outputs)
    assert [curve.name for curve in drawing.panels[0].curves] == ["virtual", "best"]


def test_a_path_that_jumps_is_drawn_as_dots_without_direction() -> None:
    levels = np.random.default_rng(0).uniform(0, 5, 100)
    recording = Recording({"pressure": levels, "displacement": levels**2}, 4.0)
    outputs = {"pi": levels}
    for drawing in (
        subjects.loop([recording], "pressure", "displacement"),
        subjects.fit_loops(recording, "pressure", "displacement", outputs),
    ):
        (panel,) = drawing.panels
        assert {curve.style for curve in panel.curves} == {"specks"}
        assert panel.arrows == ()
    against_input, against_time = subjects.residuals(
        recording, "pressure", "displacement", outputs
    ).panels
    assert (against_input.curves[0].style, against_time.curves[0].style) == ("specks", "fine")

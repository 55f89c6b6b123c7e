"""What is drawn: curves with every extremum, of the right channels, recordings and models."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mckibben.blocks.compose import Parallel, Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.laws.examples import examples
from mckibben.blocks.memoryless.piecewise_linear import PiecewiseLinear
from mckibben.blocks.play_type.gpi import GPI
from mckibben.blocks.play_type.pi import PI
from mckibben.blocks.play_type.play import Play
from mckibben.blocks.play_type.rate_dependent_pi import RateDependentPI
from mckibben.errors import ModelError
from mckibben.recording import Recording
from mckibben.report import coupling_subjects, interactive, model_subjects, subjects
from mckibben.report.drawing import along, axis_label, over_time, time_label
from mckibben.report.shown import MOST_RECORDINGS, drawn, shown
from tests.report.studies_by_hand import measured, models, study

CHANNELS = ("pressure", "displacement")
WAVE = np.sin(np.arange(100) / 5)

signals = st.integers(2, 500).flatmap(
    lambda n: arrays(np.float64, (2, n), elements=st.floats(-1e6, 1e6))
)


# -- curves --------------------------------------------------------------------------------------


@given(signals, st.integers(8, 60))
def test_thinning_keeps_the_extremes_the_order_and_the_limit(pair: np.ndarray, points: int) -> None:
    x, y = pair
    t, thinned = over_time(np.arange(y.size, dtype=float), y, points)
    assert t.size <= max(points, 2)
    assert (thinned.min(), thinned.max()) == (y.min(), y.max())
    np.testing.assert_array_equal(thinned, y[t.astype(int)])
    places, *path = along(x, y, points)
    assert places.size <= points
    assert np.all(np.diff(places) > 0)
    ends = [(one.min(), one.max()) for one in path]
    assert ends == [(x.min(), x.max()), (y.min(), y.max())]
    np.testing.assert_array_equal(np.stack(path), pair[:, places.astype(int)])


def test_every_spike_in_a_million_samples_survives() -> None:
    y = np.zeros(1_000_000)
    spikes = np.arange(777, y.size, 9973)
    y[spikes] = 1 + spikes
    _, thinned = over_time(np.arange(y.size, dtype=float), y)
    assert set(thinned[thinned > 0]) == set(y[spikes])


def test_labels_carry_units_and_time_without_time_is_samples() -> None:
    assert axis_label("pressure", "bar") == "pressure [bar]"
    assert axis_label("contraction", "") == "contraction"
    samples = {"pressure": np.array([0.0, 1.0])}
    assert time_label(Recording(samples)) == "sample"
    assert time_label(Recording(samples, 0.1)) == "time [s]"


# -- which recordings are shown ------------------------------------------------------------------


def test_a_recording_with_a_held_out_part_is_shown_once_with_its_start() -> None:
    whole = measured(400)
    (one,) = shown(study((whole.slice(0, 300),), (whole,)))
    assert one.test_from == 300
    assert all(output.shape == (400,) for output in one.outputs.values())
    found = shown(study((measured(300, seed=5),), (whole,)))  # of the same name, and no part of it
    assert [one.test_from for one in found] == [None, None]


def test_outputs_belong_to_their_recording_and_tested_ones_come_first() -> None:
    train = (measured(400), measured(300, seed=2, name="second"))
    whole = study(train, (measured(200, seed=1, name="third"),))
    found = shown(whole)
    assert [one.recording.name for one in found] == ["third", "muscle", "second"]
    assert [one.role for one in found] == ["test", "fit", "fit"]
    assert list(found[0].outputs) == [row.model for row in whole.leaderboard.rows if row.block]
    for one, place in zip(found, (2, 0, 1), strict=True):
        np.testing.assert_array_equal(one.outputs["pi"], whole.predictions["pi"][place][:, 0])


def test_recordings_tested_on_are_drawn_first_and_then_the_longest() -> None:
    train = tuple(measured(100 + 10 * k, seed=k, name=f"run {k}") for k in range(8))
    found = drawn(shown(study(train, (measured(100, seed=9, name="tested"),))))
    assert len(found) == MOST_RECORDINGS
    names = [one.recording.name for one in found]
    assert names == ["tested", "run 7", "run 6", "run 5", "run 4", "run 3"]


# -- one input and one output --------------------------------------------------------------------


def test_the_loop_of_one_recording_is_coloured_by_age_without_gaps() -> None:
    recording = measured(500)
    (panel,) = subjects.loop([recording], *CHANNELS).panels
    assert [curve.colour for curve in panel.curves] == [f"age-{k}" for k in range(1, 6)]
    for before, after in zip(panel.curves, panel.curves[1:], strict=False):
        assert (before.x[-1], before.y[-1]) == (after.x[0], after.y[0])
    joined = np.concatenate([panel.curves[0].x, *(curve.x[1:] for curve in panel.curves[1:])])
    np.testing.assert_array_equal(joined, recording["pressure"])
    (short,) = subjects.loop([recording.slice(0, 2)], *CHANNELS).panels
    assert [curve.x.size for curve in short.curves] == [2]


def test_several_recordings_share_panels_and_the_seventh_is_named() -> None:
    recordings = [measured(100, seed=k, name=f"run {k}") for k in range(8)]
    for drawing in (
        subjects.loop(recordings, *CHANNELS),
        subjects.time_course(recordings, CHANNELS),
    ):
        curves = drawing.panels[0].curves
        assert [curve.name for curve in curves] == [f"run {k}" for k in range(6)]
        assert "run 6, run 7" in drawing.note


def test_arrows_follow_time_on_both_branches() -> None:
    u = np.concatenate([np.linspace(0, 5, 100), np.linspace(5, 0, 100)])
    up, down = subjects.directions(u, 2 * u)
    assert up.tail[0] < up.head[0]
    assert down.tail[0] > down.head[0]
    assert 2 < up.tail[0] < 3


def test_residuals_are_measured_less_modelled() -> None:
    recording = measured(200)
    outputs = {"gpi": recording["displacement"] - 0.5}
    panels = subjects.residuals(recording, *CHANNELS, outputs, test_from=150).panels
    for panel in panels:
        np.testing.assert_allclose(panel.curves[0].y, 0.5)
    assert panels[1].marks[0].x == pytest.approx(1.5)


def test_the_best_model_lies_on_top_of_what_was_measured_or_virtual() -> None:
    recording = measured(100)
    outputs = dict.fromkeys(("best", "second", "third"), recording["displacement"])
    for run, kind in ((recording, "measured"), (recording.with_meta(rig="a (virtual)"), "virtual")):
        for drawing in (
            subjects.fit_over_time(run, "displacement", outputs),
            subjects.fit_loops(run, *CHANNELS, outputs),
        ):
            names = [curve.name for curve in drawing.panels[0].curves]
            assert names == [kind, "third", "second", "best"]


def test_a_path_that_jumps_is_drawn_as_dots_without_direction() -> None:
    levels = np.random.default_rng(0).uniform(0, 5, 100)
    recording = Recording({"pressure": levels, "displacement": levels**2}, 4.0)
    for drawing in (
        subjects.loop([recording], *CHANNELS),
        subjects.fit_loops(recording, *CHANNELS, {"pi": levels}),
    ):
        (panel,) = drawing.panels
        assert {curve.style for curve in panel.curves} == {"specks"}
        assert panel.arrows == ()


# -- several inputs ------------------------------------------------------------------------------


def arm(rest: str = "", shared: bool = False) -> Recording:
    """Return an arm with one input at rest, or with both moving together."""
    a, b = np.random.default_rng(0).uniform(0, 2, (2, 400))
    b = a if shared else b
    values = {"u1": a, "u2": b, "y1": 3 * a, "y2": 5 * b + a}
    units = dict(zip(values, ("bar", "bar", "mm", "mm"), strict=True))
    return Recording(values | ({rest: np.zeros(400)} if rest else {}), 0.01, units)


INPUTS, OUTPUTS = ("u1", "u2"), ("y1", "y2")


def test_effects_are_those_of_inputs_over_their_ranges() -> None:
    found = coupling_subjects.coupling([arm()], INPUTS, OUTPUTS)
    np.testing.assert_allclose(found.effects, [[6, 0], [2, 10]], atol=0.1)
    assert found.own("y2") == "u2"
    assert len(coupling_subjects.matrix(arm(), found).panels) == 4
    together = coupling_subjects.coupling([arm(shared=True)], INPUTS, OUTPUTS)
    assert np.isnan(together.effects).all()


def test_an_output_is_drawn_over_an_input_that_moves_where_it_is_drawn() -> None:
    runs = [arm("u1"), arm("u2")]
    found = coupling_subjects.coupling(runs, INPUTS, OUTPUTS)
    assert found.pairs(runs) == (("u1", "y1"), ("u2", "y2"))
    assert found.pairs(runs[:1]) == (("u2", "y1"), ("u2", "y2"))
    assert found.pairs(runs[1:]) == (("u1", "y1"), ("u1", "y2"))
    colours = [panel.curves[0].colour for panel in coupling_subjects.matrix(runs[1], found).panels]
    assert colours == ["series-1", "input", "series-1", "input"]
    values = {"displacement": np.zeros(100), "pressure": WAVE, "force": 3 * WAVE}
    isometric = coupling_subjects.coupling([Recording(values, 0.1)], ("displacement",), ("force",))
    assert isometric.pairs([Recording(values, 0.1)]) == (("pressure", "force"),)
    rest = Recording(values | {"pressure": np.zeros(100)}, 0.1)
    assert isometric.pairs([rest]) == (("displacement", "force"),)


def test_loops_are_coloured_by_a_third_channel_or_one_for_every_held_load() -> None:
    panel = coupling_subjects.loop_by([arm()], "u1", "y2", "u2").panels[0]
    assert len(panel.curves) == 5
    assert panel.x_label == "u1 [bar]"
    loads = (0.0, 10.0, 20.0)
    runs = [
        Recording({"pressure": WAVE, "displacement": WAVE - load, "force": np.full(100, load)}, 0.1)
        for load in loads
    ]
    (panel,) = coupling_subjects.loop_by(runs, *CHANNELS, "force").panels
    for curve, load in zip(panel.curves, loads, strict=True):
        assert f"{load:g} N" in curve.name
        np.testing.assert_allclose(curve.y, curve.x - load)


def test_the_recording_in_which_all_inputs_move_is_drawn() -> None:
    names = ("pressure_1", "pressure_2", "displacement_1")
    runs = [
        Recording(dict(zip(names, (a * WAVE, b * WAVE, WAVE), strict=True)), 0.1)
        for a, b in ((3.0, 0.0), (1.0, 2.0), (0.5, 3.0))
    ]
    assert coupling_subjects.fullest(runs, names[:2]) is runs[1]


# -- models --------------------------------------------------------------------------------------


def test_only_models_that_worked_are_ranked_with_their_intervals() -> None:
    (panel,) = model_subjects.leaderboard(study().leaderboard).panels
    assert panel.categories == tuple(models())
    tested = panel.curves[-1]
    assert tested.interval is not None
    assert np.all((tested.interval[0] < tested.x) & (tested.x < tested.interval[1]))
    with pytest.raises(ModelError):
        model_subjects.leaderboard(study(blocks={}).leaderboard)


def test_sums_of_operators_are_found_however_nested() -> None:
    pi, gpi, play = PI.example(), GPI.example(), Play.example()
    nested = Series((Parallel((pi, play)), PiecewiseLinear.example()))
    assert list(model_subjects.operator_sums(nested)) == [pi]
    assert list(model_subjects.operator_sums(gpi.inverse())) == [gpi]
    assert list(model_subjects.operator_sums(play)) == []


@pytest.mark.parametrize(("name", "block"), examples().items())
def test_any_model_is_drawn_or_refused(name: str, block: Block) -> None:
    if list(model_subjects.operator_sums(block)):
        interactive.plots(model_subjects.weights({name: block}))
    else:
        with pytest.raises(ModelError, match="Remedy"):
            model_subjects.weights({name: block})


def test_weights_stand_over_their_thresholds_and_no_more_than_fit() -> None:
    gpi, mpi, _, rated, _ = model_subjects.weights(models()).panels
    assert mpi.x_label == "threshold [bar]"
    np.testing.assert_array_equal(gpi.curves[0].y, GPI.example().weights)
    np.testing.assert_array_equal(rated.curves[0].y, RateDependentPI.example().rate_weights)
    drawing = model_subjects.weights({f"model {k}": PI.example() for k in range(9)})
    assert len(drawing.panels) == 6
    assert drawing.note.startswith("3 ")


def test_the_inverse_check_shows_its_own_error() -> None:
    check = study().inverse
    assert check is not None
    following, error, given = model_subjects.inverse_check(check).panels
    assert (following.y_label, given.y_label) == ("displacement [mm]", "pressure [bar]")
    np.testing.assert_array_equal(error.curves[0].y, check.output - check.reference)

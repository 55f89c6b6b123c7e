"""Figures: of the right channels and models, alike twice in every format, as plotly takes them."""

from __future__ import annotations

import json
from base64 import b64decode
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.diagnosis.coupling import coupling
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording
from mckibben.report import printed, subjects
from mckibben.report.drawing import Curve, Drawing, Panel, along, over_time
from mckibben.report.figures import (
    FIGURES,
    draw,
    pair_of,
    write_figure,
)
from mckibben.report.interactive import packed, plots, text
from mckibben.report.modelled_runs import runs_of_study
from tests.refusals import refused
from tests.report.studies_by_hand import measured, plain_study, study

CHANNELS = ("pressure", "displacement")
SIGNATURES = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
HOSTILE = "<a href='http://x.example'>&amp;</a>"


def drawing() -> Drawing:
    x = np.linspace(0, 1, 20)
    curve = Curve(x, x**2, "a", "series-1", model="a")
    return Drawing((Panel("a", "a", (curve,), "a"),))


# -- what is drawn -------------------------------------------------------------------------------

signals = st.integers(2, 500).flatmap(
    lambda n: arrays(np.float64, (2, n), elements=st.floats(-1e6, 1e6))
)


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


def test_a_recording_with_a_held_out_part_is_shown_once_with_its_start() -> None:
    whole = measured(400)
    (one,) = runs_of_study(study((whole.slice(0, 300),), (whole,)))
    assert one.test_from == 300
    assert all(output.shape == (400,) for output in one.outputs.values())
    other = measured(300, seed=5)  # of the same name, and no part of it
    found = runs_of_study(study((other,), (whole,)))
    assert [one.test_from for one in found] == [None, None]


def test_outputs_belong_to_their_recording_and_tested_ones_come_first() -> None:
    train = (measured(400), measured(300, seed=2, name="second"))
    whole = study(train, (measured(200, seed=1, name="third"),))
    found = runs_of_study(whole)
    assert [one.recording.name for one in found] == ["third", "muscle", "second"]
    assert [one.role for one in found] == ["test", "fit", "fit"]
    assert list(found[0].outputs) == [row.model for row in whole.leaderboard.rows if row.block]
    for one, place in zip(found, (2, 0, 1), strict=True):
        np.testing.assert_array_equal(one.outputs["pi"], whole.predictions["pi"][place][:, 0])


def test_residuals_are_measured_less_modelled() -> None:
    recording = measured(200)
    outputs = {"gpi": recording["displacement"] - 0.5}
    panels = subjects.against("residuals", recording, CHANNELS, outputs, 150).panels
    for panel in panels:
        np.testing.assert_allclose(panel.curves[0].y, 0.5)
    assert panels[1].marks[0].x == pytest.approx(1.5)


@pytest.mark.parametrize(("error", "narrow"), [(1e-13, True), (0.1, False)])
def test_rounding_fills_no_panel(error: float, narrow: bool) -> None:
    recording = measured(200)
    y = recording["displacement"]
    outputs = {"gpi": y - error * np.sin(np.arange(200))}
    for panel in subjects.against("residuals", recording, CHANNELS, outputs).panels:
        assert (panel.y_range is not None) == narrow
        if panel.y_range is not None:
            assert panel.y_range[1] - panel.y_range[0] == pytest.approx(1e-6 * np.ptp(y))


def test_the_pair_of_a_recording_is_what_drives_and_what_moves() -> None:
    x = np.linspace(0.0, 1.0, 50)
    for names, pair in (
        (("displacement", "voltage"), ("voltage", "displacement")),
        (("pressure", "angle"), ("pressure", "angle")),
        (("force", "time_of_day"), None),
    ):
        assert pair_of(Recording(dict.fromkeys(names, x), 0.1)) == pair
    still = Recording({"pressure": 0 * x, "displacement": x}, 0.1)
    assert pair_of(still) is None


def arm(rest: str = "", shared: bool = False) -> Recording:
    """Return an arm with one input at rest, or with both moving together."""
    a, b = np.random.default_rng(0).uniform(0, 2, (2, 400))
    b = a if shared else b
    values = {"u1": a, "u2": b, "y1": 3 * a, "y2": 5 * b + a}
    units = dict(zip(values, ("bar", "bar", "mm", "mm"), strict=True))
    return Recording(values | ({rest: np.zeros(400)} if rest else {}), 0.01, units)


INPUTS, OUTPUTS = ("u1", "u2"), ("y1", "y2")


def test_effects_are_those_of_inputs_over_their_ranges() -> None:
    found = coupling([arm()], INPUTS, OUTPUTS)
    np.testing.assert_allclose(found.effects, [[6, 0], [2, 10]], atol=0.1)
    assert found.own("y2") == "u2"
    together = coupling([arm(shared=True)], INPUTS, OUTPUTS)
    assert np.isnan(together.effects).all()


def test_an_output_is_drawn_over_an_input_that_moves_where_it_is_drawn() -> None:
    runs = [arm("u1"), arm("u2")]
    found = coupling(runs, INPUTS, OUTPUTS)
    assert found.pairs(runs) == (("u1", "y1"), ("u2", "y2"))
    assert found.pairs(runs[:1]) == (("u2", "y1"), ("u2", "y2"))
    assert found.pairs(runs[1:]) == (("u1", "y1"), ("u1", "y2"))


# -- for print -----------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", list(SIGNATURES))
def test_every_format_is_written_alike_twice(tmp_path: Path, ending: str) -> None:
    first, second = tmp_path / f"first.{ending}", tmp_path / f"second.{ending}"
    for path in (first, second):
        printed.save(drawing(), path)
    assert first.read_bytes() == second.read_bytes()
    assert first.read_bytes().startswith(SIGNATURES[ending])


@pytest.mark.parametrize(
    ("thing", "kind"), [(t, k) for t in ("recording", "block", "study") for k in FIGURES[t]]
)
def test_every_kind_is_drawn_for_print(tmp_path: Path, thing: str, kind: str) -> None:
    path = tmp_path / "figure.svg"
    step = 0.01 if kind == "spectrum" else None
    runs = [measured(200, sample_time=step), measured(100, sample_time=step, name="second")]
    if thing == "recording":
        write_figure(runs, path, kind)
    elif kind == "loop" and thing == "block":
        write_figure(GPI.example(), path, kind, high=5.0)
    elif thing == "block":
        write_figure(GPI.example(), path, kind, recording=[measured(200), measured(100, seed=1)])
    else:
        write_figure(plain_study(), path, kind)
    assert path.stat().st_size > 1000


@pytest.mark.parametrize("name", ["figure.jpg", "figure", "figure.png.txt", "nowhere/figure.png"])
def test_other_formats_and_absent_folders_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(DataError) as caught:
        printed.save(drawing(), tmp_path / name)
    assert caught.value.remedy
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_drawn_is_named_and_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "figure.png"
    for kind in ("pie", "fit"):
        with pytest.raises(ModelError):
            write_figure([measured(50)], path, kind)
    with refused(DataError, channel="force"):
        write_figure([measured(50)], path, "time", input="pressure", output="force")
    for name in ("leaderboard", "fit", "loops", "residuals"):
        with pytest.raises(ModelError):
            write_figure(study(blocks={}), path, name)
    assert list(tmp_path.iterdir()) == []


# -- for the page --------------------------------------------------------------------------------


def unpacked(value: Any) -> Any:
    """Do what the page's script does, with black for every colour."""
    if isinstance(value, dict) and "f4" in value:
        single = np.frombuffer(b64decode(value["f4"]), dtype="<f4")
        return (single.astype(float) + value["base"]).tolist()
    if isinstance(value, dict):
        return {key: unpacked(item) for key, item in value.items()}
    if isinstance(value, list):
        return [unpacked(item) for item in value]
    return "black" if isinstance(value, str) and value.startswith("--") else value


@given(
    arrays(np.float64, st.integers(1, 50), elements=st.floats(-1e3, 1e3)),
    st.floats(-1e9, 1e9),
)
def test_packing_keeps_seven_digits_of_the_range_and_gaps(values: np.ndarray, far: float) -> None:
    moved = values + far
    back = np.array(unpacked(packed(moved)))
    assert np.all(np.abs(back - moved) <= 2e-7 * np.ptp(moved) + 1e-37)
    torn = np.array([np.nan, 1.0, np.nan, 2.0])
    np.testing.assert_array_equal(unpacked(packed(torn)), torn)


@pytest.mark.parametrize("name", list(FIGURES["study"]))
def test_every_figure_is_one_that_plotly_knows(name: str) -> None:
    import plotly.graph_objects as go

    for plot in plots(draw(plain_study(), name)):
        found = unpacked(json.loads(json.dumps(plot, allow_nan=False)))
        go.Figure(found)  # refuses unknown properties and values


def test_names_are_shown_verbatim() -> None:
    curve = Curve(np.zeros(1), np.zeros(1), HOSTILE, model=HOSTILE)
    panel = Panel(HOSTILE, HOSTILE, (curve,), HOSTILE, categories=(HOSTILE,))
    (plot,) = plots(Drawing((panel,)))
    escaped = "&lt;a href='http://x.example'&gt;&amp;amp;&lt;/a&gt;"
    assert text(HOSTILE) == escaped
    layout = plot["layout"]
    found = [layout["xaxis"]["title"]["text"], layout["title"]["text"], plot["data"][0]["name"]]
    assert [*found, *layout["yaxis"]["ticktext"]] == [escaped] * 4

"""Figures: written alike twice in every format for print, and as plots that plotly takes."""

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

from mckibben.blocks.core.fields import Channel
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.play_type.gpi import GPI
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording
from mckibben.report import model_subjects, printed, subjects
from mckibben.report.drawing import Curve, Drawing, Panel
from mckibben.report.figures import (
    FIGURES,
    MODEL_KINDS,
    RECORDING_KINDS,
    plot_model,
    plot_recording,
)
from mckibben.report.interactive import packed, plots, text
from tests.report.studies_by_hand import measured, models, study

CHANNELS = ("pressure", "displacement")
SIGNATURES = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
HOSTILE = "<a href='http://x.example'>&amp;</a>"


def drawing(name: str = "a") -> Drawing:
    x = np.linspace(0, 1, 20)
    curve = Curve(x, x**2, name, "series-1", model=name)
    return Drawing((Panel(name, name, (curve,), name),))


# -- for print -----------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", list(SIGNATURES))
def test_every_format_is_written_alike_twice_at_the_resolution_of_print(
    tmp_path: Path, ending: str
) -> None:
    from matplotlib import rcParams
    from PIL import Image

    before = dict(rcParams)
    first, second = tmp_path / f"first.{ending}", tmp_path / f"second.{ending}"
    for path in (first, second):
        printed.save(drawing(), path)
    assert first.read_bytes() == second.read_bytes()
    assert first.read_bytes().startswith(SIGNATURES[ending])
    assert dict(rcParams) == before
    if ending == "png":
        with Image.open(first) as image:
            assert image.width == round(printed.COLUMN * printed.RESOLUTION)


@pytest.mark.parametrize("kind", [*RECORDING_KINDS, *MODEL_KINDS, *FIGURES])
def test_every_kind_is_drawn_for_print(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "figure.svg"
    runs = [measured(200, sample_time=None), measured(100, sample_time=None, name="second")]
    if kind in RECORDING_KINDS:
        plot_recording(runs, *CHANNELS, kind, path)
    elif kind in MODEL_KINDS:
        plot_model(GPI.example(), [measured(200), measured(100, seed=1)], kind, path)
    else:
        printed.save(FIGURES[kind](study()), path)
    assert path.stat().st_size > 1000


def test_more_recordings_than_are_drawn_are_no_error(tmp_path: Path) -> None:
    many = [measured(60, seed=k, name=f"run {k}") for k in range(8)]
    plot_model(GPI.example(), many, "fit", tmp_path / "figure.svg")
    printed.save(FIGURES["loops"](study(tuple(many[:4]), tuple(many[4:]))), tmp_path / "loops.svg")


@pytest.mark.parametrize("name", ["$x^", "_hidden", "a\nb", "<b>&", r"\frac", "{}", "%s"])
def test_names_are_drawn_as_they_are(tmp_path: Path, name: str) -> None:
    printed.save(drawing(name), tmp_path / "figure.svg")
    legend = printed.drawn(drawing(name)).axes[0].get_legend()
    assert legend is not None
    assert [entry.get_text().strip() for entry in legend.get_texts()] == [name.replace("\n", " ")]


def test_a_model_is_drawn_over_an_input_that_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Drawing] = []
    monkeypatch.setattr(printed, "save", lambda drawing, path: drawn.append(drawing))
    wave = np.sin(np.arange(100) / 5)
    names = ("pressure_1", "pressure_2", "displacement")
    runs = [
        Recording(dict(zip(names, (one, two, one + 2 * two), strict=True)), 0.1)
        for one, two in ((wave, 0 * wave), (0 * wave, wave), (wave, wave**2))
    ]
    driven = (Channel("pressure_1", "bar"), Channel("pressure_2", "bar"))
    block = Coupling(((1.0,), (2.0,)), driven, (Channel("displacement", "mm"),))
    plot_model(block, runs, "loops", tmp_path / "figure.pdf")
    found = [panel.x_label.partition(" ")[0] for panel in drawn[0].panels]
    assert found == ["pressure_1", "pressure_2", "pressure_2"]


@pytest.mark.parametrize("name", ["figure.jpg", "figure", "figure.png.txt", "nowhere/figure.png"])
def test_other_formats_and_absent_folders_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(DataError) as refused:
        printed.save(drawing(), tmp_path / name)
    assert refused.value.remedy
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_drawn_is_named_and_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "figure.png"
    with pytest.raises(ModelError, match="time, loop"):
        plot_recording([measured(50)], *CHANNELS, "pie", path)
    with pytest.raises(ModelError, match="fit, loops, residuals, weights"):
        plot_model(GPI.example(), [measured(50)], "time", path)
    with pytest.raises(DataError, match="force"):
        plot_recording([measured(50)], "pressure", "force", "time", path)
    with pytest.raises(ModelError, match="inverse"):
        printed.save(FIGURES["inverse"](study(inverse=False)), path)
    for name in ("leaderboard", "fit", "loops", "residuals", "weights"):
        with pytest.raises(ModelError):
            printed.save(FIGURES[name](study(blocks={})), path)
    assert list(tmp_path.iterdir()) == []


def test_every_colour_is_defined_for_print() -> None:
    recordings = [measured(50, seed=k, name=f"run {k}") for k in range(6)]
    used = {"measured", "input"}
    for some in (recordings, recordings[:1]):
        for panel in subjects.loop(some, *CHANNELS).panels:
            used |= {curve.colour for curve in panel.curves}
    assert used == set(printed.COLOURS)


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


@pytest.mark.parametrize("name", list(FIGURES))
def test_every_figure_is_one_that_plotly_knows(name: str) -> None:
    import plotly.graph_objects as go

    for plot in plots(FIGURES[name](study())):
        found = unpacked(json.loads(json.dumps(plot, allow_nan=False)))
        go.Figure(found)  # refuses unknown properties and values


def test_stacked_panels_make_one_plot_and_others_one_each() -> None:
    (plot,) = plots(subjects.time_course([measured(50)], CHANNELS))
    assert plot["layout"]["xaxis2"]["matches"] == "x"
    low, high = (plot["layout"][name]["domain"] for name in ("yaxis2", "yaxis"))
    assert 0 == low[0] < low[1] < high[0] < high[1] == 1
    assert len(plots(model_subjects.weights(models()))) == 5
    (chart,) = plots(model_subjects.leaderboard(study().leaderboard))
    axis = chart["layout"]["yaxis"]
    assert axis["ticktext"][0] == "gpi"
    assert axis["range"][0] > axis["range"][1]  # the best at the top


def test_names_are_shown_verbatim() -> None:
    curve = Curve(np.zeros(1), np.zeros(1), HOSTILE, model=HOSTILE)
    panel = Panel(HOSTILE, HOSTILE, (curve,), HOSTILE, categories=(HOSTILE,))
    (plot,) = plots(Drawing((panel,)))
    escaped = "&lt;a href='http://x.example'&gt;&amp;amp;&lt;/a&gt;"
    assert text(HOSTILE) == escaped
    layout = plot["layout"]
    found = [layout["xaxis"]["title"]["text"], layout["title"]["text"], plot["data"][0]["name"]]
    assert [*found, *layout["yaxis"]["ticktext"]] == [escaped] * 4

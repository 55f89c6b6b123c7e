from __future__ import annotations

import json
from base64 import b64decode
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mckibben.report import figures, model_subjects, subjects
from mckibben.report.drawing import Curve, Drawing, Panel
from mckibben.report.interactive import packed, plots, text
from tests.report.studies_by_hand import measured, models, study


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
    arrays(np.float64, st.integers(0, 50), elements=st.floats(-1e3, 1e3)),
    st.floats(-1e9, 1e9),
)
def test_packing_keeps_seven_digits_of_the_range(values: np.ndarray, far: float) -> None:
    moved = values + far
    back = np.array(unpacked(packed(moved)))
    assert np.all(np.abs(back - moved) <= 2e-7 * np.ptp(moved) + 1e-37) if moved.size else True


def test_gaps_stay_gaps() -> None:
    back = unpacked(packed(np.array([np.nan, 1.0, np.nan, 2.0])))
    np.testing.assert_array_equal(back, [np.nan, 1.0, np.nan, 2.0])


@pytest.mark.parametrize("name", list(figures.FIGURES))
def test_every_figure_is_one_that_plotly_knows(name: str) -> None:
    import plotly.graph_objects as go

    for plot in plots(figures.FIGURES[name](study())):
        found = unpacked(json.loads(json.dumps(plot, allow_nan=False)))
        go.Figure(found)  # refuses unknown properties and values


def test_stacked_panels_make_one_plot_and_others_one_each() -> None:
    stacked = subjects.time_course([measured(50)], ("pressure", "displacement"))
    (plot,) = plots(stacked)
    assert plot["layout"]["xaxis2"]["matches"] == "x"
    low, high = (plot["layout"][name]["domain"] for name in ("yaxis2", "yaxis"))
    assert 0 == low[0] < low[1] < high[0] < high[1] == 1
    assert len(plots(model_subjects.weights(models()))) == 5


def test_the_best_model_is_at_the_top_of_the_chart() -> None:
    (plot,) = plots(model_subjects.leaderboard(study().leaderboard))
    axis = plot["layout"]["yaxis"]
    assert axis["ticktext"][0] == "gpi"
    assert axis["range"][0] > axis["range"][1]


def test_names_are_shown_verbatim() -> None:
    words = "<a href='http://x.example'>&amp;</a>"
    curve = Curve(np.zeros(1), np.zeros(1), words, model=words)
    (plot,) = plots(Drawing((Panel(words, words, (curve,), words, categories=(words,)),)))
    shown = "&lt;a href='http://x.example'&gt;&amp;amp;&lt;/a&gt;"
    assert text(words) == shown
    layout = plot["layout"]
    assert layout["xaxis"]["title"]["text"] == shown
    assert layout["title"]["text"] == shown
    assert layout["yaxis"]["ticktext"] == [shown]
    assert plot["data"][0]["name"] == shown

"""Figures of papers: readable as printed, and what is drawn is what was computed."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import registry
from mckibben.checkpoints import Checkpoints
from mckibben.papers.experiment import Axes, Experiment, Reproduction, reproduce
from mckibben.papers.paper import paper
from mckibben.report.drawing import N_COLOURS, Drawing
from mckibben.report.interactive import plots
from mckibben.report.reproduction import comparison, drawing
from tests.report.legible import assert_readable

PAPERS = registry.names("papers")
T = np.linspace(0.0, 10.0, 400)
U, Y = 1 - np.cos(T), 20 * (1 - np.cos(T - 0.2))
PATH, INK = (U, Y), "virtual rig"


def pictures(found: Reproduction) -> list[Drawing]:
    """Return all figures of a re-run: the paper's, and tables that are drawn."""
    compared = [comparison(table) for table in found.tables if table.text.drawn]
    return [*(drawing(one) for one in found.figures), *compared]


def drawn(name: str, key: str, panels: dict[str, Axes]) -> Drawing:
    """Return a figure of a paper with panels by hand."""
    experiment = Experiment(name, None, None, checkpoints=Checkpoints(None))
    experiment.figure(key, panels, unit="[V]")
    return drawing(experiment.figures[-1])


@pytest.mark.parametrize(("name", "key"), [(n, key) for n in PAPERS for key in paper(n).figures])
def test_every_figure_is_readable_with_many_models_that_leave_it(name: str, key: str) -> None:
    off = {f"model {k}, which has a long name": (U, Y * (k / 3) ** 3) for k in range(6)}
    keys = ["", *paper(name).figures[key].axes]
    panels = {
        f"recording-{place}": Axes({INK: PATH} | off, axes, [(1.0, 2.0), (3.0, 4.0)])
        for place, axes in enumerate((keys * 9)[:9])
    }
    assert_readable(drawn(name, key, panels))


@pytest.mark.long
@pytest.mark.parametrize("name", ["activation-pressure", "field-models", "multistate-friction"])
def test_figures_of_a_quick_run_are_readable(name: str) -> None:
    for picture in pictures(reproduce(name, quick=True, jobs=1)):
        assert_readable(picture)


def test_an_outlier_leaves_the_panel_with_a_mark_and_hides_nothing() -> None:
    models = {"near": (U, Y + 1), "far": (U, Y + 500), "wild": (U, np.where(U > 1.5, np.inf, Y))}
    picture = drawn("sdchm", "tracking", {"": Axes({INK: PATH} | models)})
    (panel,) = picture.panels
    assert panel.limits is not None
    low, high = panel.limits
    assert low < Y.min() < Y.max() + 1 < high < Y.max() + 10
    heads = {curve.colour: curve for curve in panel.curves if curve.style == "above"}
    curves = {curve.name: curve for curve in panel.curves if curve.name}
    assert {*heads} == {curves["far"].colour, curves["wild"].colour}
    assert all(low < float(head.y[0]) < high for head in heads.values())
    assert len({float(head.x[0]) for head in heads.values()}) == len(heads)
    assert all(np.isfinite(curve.y).all() for curve in panel.curves)
    np.testing.assert_array_equal(curves["near"].y, Y + 1)
    assert "far" in picture.note
    assert plots(picture)[0]["layout"]["yaxis"]["range"] == [low, high]


def test_a_held_reference_is_seen_among_what_moves() -> None:
    """Muscles that are held are drawn on the scale of the one that moves."""
    still = np.full(T.size, 33.0)
    held, moves = {"reference": (U, still), "a": (U, still + 3)}, {"reference": PATH, "a": PATH}
    first, second = drawn("sdchm", "tracking", {"1": Axes(moves), "2": Axes(held)}).panels
    assert first.limits is second.limits is None
    alone = Axes({"reference": (U, still)})
    _, noise = drawn("sdchm", "tracking", {"1": Axes(moves), "2": alone}).panels
    assert noise.y_range is not None
    assert noise.y_range[1] - noise.y_range[0] == pytest.approx(0.1 * np.ptp(Y))


def test_points_in_no_order_are_no_line_and_few_in_order_are_beads() -> None:
    scattered = np.random.default_rng(0).permutation(T)
    curves = {"far": (scattered, Y), "few": (T[::40], Y[::40]), "path": PATH}
    (panel,) = drawn("activation-pressure", "extrema", {"": Axes(curves)}).panels
    styles = {curve.name: curve.style for curve in panel.curves}
    assert styles == {"far": "specks", "few": "beads", "path": "line"}


def test_more_curves_than_colours_are_named_and_not_drawn() -> None:
    curves = {f"{k} N": PATH for k in range(N_COLOURS + 3)}
    picture = drawn("activation-pressure", "static", {"before": Axes(curves)})
    assert len(picture.panels[0].curves) == N_COLOURS
    assert f"{N_COLOURS + 2} N" in picture.note
    assert_readable(picture)

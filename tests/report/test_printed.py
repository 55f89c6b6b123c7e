"""Figures for print: of a journal's width, with nothing cut off, and legible in grey."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.laws import examples
from mckibben.recording import Recording
from mckibben.report.drawing import N_COLOURS, Curve, Drawing, Label, Panel
from mckibben.report.figures import FIGURES, draw, write_figure
from tests.report.legible import MILLIMETRES, assert_legible, made
from tests.report.studies_by_hand import measured, plain_study

LONG = "2026-03-14_muscle-of-220-mm_load-{}N_triangle-decaying_0.05Hz_repetition-{}.csv"


def runs(n: int) -> list[Recording]:
    return [measured(300, seed=k, name=LONG.format(20 * k, k) * (1 + k % 2)) for k in range(n)]


def arm(name: str) -> Recording:
    """Return inputs and outputs of two muscles with an extensor, under a load."""
    block, t = examples()["balance-inverse"], np.arange(0, 10, 0.05)
    waves = {"pressure_extensor": 2.0, "force": 50.0}
    given = {one.name: waves.get(one.name, 2 + np.sin(t)) + 0 * t for one in block.inputs}
    made = {one.name: 5 + 3 * np.sin(t) for one in block.outputs}
    units = {one.name: one.unit for one in (*block.inputs, *block.outputs)}
    return Recording(given | made, 0.05, units, meta={"name": name})


def models_of(kind: str) -> Drawing:
    board = plain_study().leaderboard
    every = [row.model for row in board.rows if row.block is not None]
    return draw(board, kind, recording=runs(2), models=every)


def muscles(kind: str) -> Drawing:
    two = [arm(LONG), arm("short")]
    return draw(examples()["balance-inverse"], kind, recording=two, input="pressure_1")


def too_long() -> Drawing:
    x = np.linspace(0, 1, 9)
    curves = [Curve(x, k + x**2, LONG * 2, f"series-{k + 1}") for k in range(N_COLOURS)]
    label = Label(
        "$W_{ displacement of the left upper arm against its stop" * 2, "$", r"\epsilon_{1}"
    )
    panel = Panel(label, "", tuple(curves), "$W_{" * 30, categories=(LONG, "b"))
    return Drawing((panel,), note="W" * 200)


def of_runs(kind: str, n: int) -> Drawing:
    return draw(runs(n), kind)


def on_runs(kind: str, n: int) -> Drawing:
    return draw(GPI.example(), kind, recording=runs(n))


def of_study(kind: str) -> Drawing:
    return draw(plain_study(), kind)


AGAINST = ("loops", "fit", "residuals")
ON = (("loops", 7), ("fit", 1), ("fit", 3), ("residuals", 2))
CASES: dict[str, Callable[[], Drawing]] = {
    **{f"{k} of {n}": partial(of_runs, k, n) for k in FIGURES["recording"] for n in (1, 3, 12)},
    **{f"{kind} on {n}": partial(on_runs, kind, n) for kind, n in ON},
    **{f"{kind} of a study": partial(of_study, kind) for kind in FIGURES["study"]},
    **{f"{kind} of models": partial(models_of, kind) for kind in AGAINST},
    **{f"{kind} of muscles": partial(muscles, kind) for kind in AGAINST},
    "time of muscles": lambda: draw(arm(LONG), "time"),
    "too long": too_long,
}
"""Every kind of figure: of one muscle and of several, of few and of many recordings."""


@cache
def drawing(case: str) -> Drawing:
    return CASES[case]()


@pytest.mark.parametrize("columns", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize("case", CASES)
def test_a_figure_fits_its_columns_and_is_legible(case: str, columns: Literal[1, 2]) -> None:
    with made(drawing(case), columns) as figure:
        assert_legible(figure, columns)


@pytest.mark.parametrize("columns", MILLIMETRES)
@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_vectors_hold_text_and_pixels_are_fine(
    tmp_path: Path, ending: str, columns: Literal[1, 2]
) -> None:
    path = tmp_path / f"figure.{ending}"
    write_figure(runs(2), path, "loop", width=columns)
    content = path.read_bytes()
    if ending == "svg":
        assert b">2026-03-14_muscle" in content
    if ending == "png":
        assert struct.unpack(">I", content[16:20])[0] >= 300 * MILLIMETRES[columns] / 25.4
    if ending == "pdf":
        assert b"/Font" in content


def test_axes_have_the_symbols_of_the_equations(tmp_path: Path) -> None:
    (loop,) = draw(arm("arm"), "loop", input="pressure_1", output="displacement_2").panels
    assert (loop.x_label, loop.y_label) == (
        Label("pressure_1", "bar", "p_{1}"),
        Label("displacement_2", "mm", "y_{2}"),
    )
    (fit,) = draw(GPI.example(), "loops", recording=measured(100)).panels
    assert fit.x_label == Label("pressure", "bar", "u")


def test_axes_that_are_given_get_their_legends() -> None:
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, layout="constrained", figsize=(7, 4))
    try:
        drawn = GPI.example().plot("loops", recording=runs(2), ax=axes)
        figure.draw_without_rendering()
        for axis, panel in zip(drawn, on_runs("loops", 2).panels, strict=True):
            legend, box = axis.get_legend(), axis.get_window_extent()
            assert legend.get_window_extent().width <= 1.3 * box.width  # the layout came after it
            assert not legend.get_window_extent().padded(-1).overlaps(box)
            assert legend.get_title().get_text().replace("\n", "") == panel.title
    finally:
        pyplot.close(figure)


def test_labels_are_no_mathematics() -> None:
    with made(Drawing((Panel("$a$", Label("$b$", "$"), ()),))) as figure:
        (axis,) = figure.axes
        assert axis.get_xlabel() == r"\$a\$"
        assert axis.get_ylabel() == r"\$b\$ [\$]"


def test_a_plot_is_of_a_journals_width_where_that_is_asked_for() -> None:
    from matplotlib import pyplot

    for columns, width in MILLIMETRES.items():
        figure = runs(1)[0].plot("loop", width=columns).figure
        assert 25.4 * figure.get_size_inches()[0] == pytest.approx(width)
        pyplot.close(figure)

"""The figures of this package, each described from recordings, outputs and models."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.recording import Recording
from mckibben.report.drawing import (
    FEW,
    JUMP,
    N_AGES,
    N_COLOURS,
    POINTS,
    Arrow,
    Curve,
    Drawing,
    Mark,
    Panel,
    Style,
    along,
    axis_label,
    over_time,
    series_colour,
    time_label,
)

if TYPE_CHECKING:
    from mckibben.comparison.results import InverseCheck, Leaderboard

Array = NDArray[np.float64]
Outputs = Mapping[str, Array]
"""Model name to its output on one recording, best first."""


def time_course(
    recordings: Sequence[Recording], channels: Sequence[str], points: int = POINTS
) -> Drawing:
    """Draw channels over time, one panel each; several recordings share the panels."""
    kept, note = _first(recordings)
    colours = _colours(kept)
    panels = []
    for channel in channels:
        curves = []
        for recording, (name, colour) in zip(kept, colours, strict=True):
            t, y = over_time(recording.time, recording[channel], points)
            name = name if channel == channels[0] else ""
            curves.append(Curve(t, y, name, colour, _measured_style(recording)))
        label = axis_label(channel, kept[0].units[channel])
        panels.append(Panel(time_label(kept[0]), label, tuple(curves)))
    return Drawing(tuple(panels), stacked=True, note=note)


def loop(
    recordings: Sequence[Recording], input_name: str, output_name: str, points: int = POINTS
) -> Drawing:
    """Draw the output over the input: a single recording from early to late, several by colour."""
    kept, note = _first(recordings)
    x_label, y_label = _plane(kept[0], input_name, output_name)
    arrows = directions(kept[0][input_name], kept[0][output_name])
    if len(kept) == 1:
        curves = _by_age(kept[0], input_name, output_name, points)
    else:
        curves = tuple(
            Curve(
                *along(recording[input_name], recording[output_name], points)[1:],
                name,
                colour,
                _path_style(recording[input_name], _measured_style(recording)),
            )
            for recording, (name, colour) in zip(kept, _colours(kept), strict=True)
        )
    return Drawing((Panel(x_label, y_label, curves, arrows=arrows),), note=note)


def leaderboard(board: Leaderboard) -> Drawing:
    """Draw the errors of all models that worked, with the interval of the test error.

    Raises
    ------
    ModelError
        If none worked.
    """
    ranked = [row for row in board.rows if row.train is not None and row.test is not None]
    if not ranked:
        raise ModelError("no model worked, so there is nothing to rank. Remedy: read the reasons.")
    place = np.arange(len(ranked), dtype=float)
    tested = np.array([row.test.rmse for row in ranked if row.test is not None])
    fitted = np.array([row.train.rmse for row in ranked if row.train is not None])
    chosen = [row.validation_rmse for row in ranked]
    ends = np.array([row.rmse_interval or (np.nan, np.nan) for row in ranked], dtype=float)
    ends = np.where(np.isfinite(ends), ends, tested[:, np.newaxis])
    curves = [Curve(fitted, place, "fit", "input", "ticks")]
    if any(value is not None for value in chosen):
        validated = np.array([np.nan if value is None else value for value in chosen])
        curves.append(Curve(validated, place, "cross-validation", "input", "rings"))
    interval = (ends[:, 0], ends[:, 1])
    curves.append(Curve(tested, place, "test, 95 % interval", "series-1", "dots", None, interval))
    label = axis_label("RMSE", board.unit)
    names = tuple(row.model for row in ranked)
    return Drawing((Panel(label, "", tuple(curves), categories=names),))


def fit_over_time(
    recording: Recording,
    output_name: str,
    outputs: Outputs,
    test_from: int | None = None,
    points: int = POINTS,
) -> Drawing:
    """Draw the measured output over time and the models' on top, the best last."""
    time = recording.time
    under = _measured_style(recording, under=True)
    curves = [Curve(*over_time(time, recording[output_name], points), "measured", style=under)]
    for model, colour, modelled in _worst_to_best(outputs):
        curves.append(Curve(*over_time(time, modelled, points), model, colour, model=model))
    label = axis_label(output_name, recording.units[output_name])
    marks = _test_mark(time, test_from)
    panel = Panel(time_label(recording), label, tuple(curves), marks=marks)
    return Drawing((panel,), columns=1)


def fit_loops(
    recording: Recording,
    input_name: str,
    output_name: str,
    outputs: Outputs,
    points: int = POINTS,
) -> Drawing:
    """Draw the measured loop and the models' on top, the best last."""
    u = recording[input_name]
    measured = recording[output_name]
    under = _path_style(u, _measured_style(recording, under=True))
    over = _path_style(u, "line")
    curves = [Curve(*along(u, measured, points)[1:], "measured", style=under)]
    for model, colour, modelled in _worst_to_best(outputs):
        curves.append(Curve(*along(u, modelled, points)[1:], model, colour, over, model))
    x_label, y_label = _plane(recording, input_name, output_name)
    return Drawing((Panel(x_label, y_label, tuple(curves), arrows=directions(u, measured)),))


def residuals(
    recording: Recording,
    input_name: str,
    output_name: str,
    outputs: Outputs,
    test_from: int | None = None,
    points: int = POINTS,
) -> Drawing:
    """Draw measured less modelled output against the input, and against time."""
    u, measured = recording[input_name], recording[output_name]
    against_input, against_time = [], []
    for model, colour, modelled in _worst_to_best(outputs):
        left = measured - modelled
        path, course = along(u, left, points)[1:], over_time(recording.time, left, points)
        against_input.append(Curve(*path, model, colour, _path_style(u, "fine"), model))
        against_time.append(Curve(*course, "", colour, "fine", model))
    x_label = axis_label(input_name, recording.units[input_name])
    y_label = axis_label("measured − model", recording.units[output_name])
    marks = _test_mark(recording.time, test_from)
    return Drawing(
        (
            Panel(x_label, y_label, tuple(against_input), zero=True),
            Panel(time_label(recording), y_label, tuple(against_time), marks=marks, zero=True),
        ),
        columns=2,
    )


def weights(blocks: Mapping[str, Block]) -> Drawing:
    """Draw the weights over the thresholds of every sum of play operators in the models.

    Raises
    ------
    ModelError
        If no model has any.
    """
    panels = []
    for place, (model, block) in enumerate(blocks.items()):
        for part in operator_sums(block):
            unit = part.inputs[0].unit
            threshold = "threshold on the envelopes" if part.kind == "gpi" else "threshold"
            x_label = axis_label(threshold, "" if part.kind == "gpi" else unit)
            r = np.array(part.thresholds)  # type: ignore[attr-defined]
            w = np.array(part.weights)  # type: ignore[attr-defined]
            title = model if part is block else f"{model}: {part.kind}"
            drawn = {title: w}
            if hasattr(part, "rate_weights"):
                drawn[f"{title}, per rate"] = np.array(part.rate_weights)
            for heading, values in drawn.items():
                stems = Curve(r, values, colour=series_colour(place), style="stems")
                panels.append(Panel(x_label, "weight", (stems,), heading, zero=True))
    if not panels:
        raise ModelError(
            "no model here is a weighted sum of play operators, so it has no weights to draw. "
            "Remedy: draw the fit or the loops."
        )
    note = "" if len(panels) <= N_COLOURS else f"{len(panels) - N_COLOURS} more are not shown."
    return Drawing(tuple(panels[:N_COLOURS]), note=note)


def operator_sums(block: Block) -> Iterator[Block]:
    """Yield the parts of a model, however nested, that are weighted sums of play operators."""
    if hasattr(block, "thresholds") and hasattr(block, "weights"):
        yield block
    elif hasattr(block, "forward"):
        yield from operator_sums(block.forward)
    else:
        for part in getattr(block, "parts", ()):
            yield from operator_sums(part)


def inverse_check(check: InverseCheck, timed: bool = True) -> Drawing:
    """Draw reference and output, their difference, and the input that the inverse gives.

    Parameters
    ----------
    timed : bool
        Whether ``check.time`` is in seconds, and not in samples.
    """
    (wanted,), (given,) = check.inverse.inputs[:1], check.inverse.outputs[:1]
    label = "time [s]" if timed else "sample"
    t = check.time
    error = over_time(t, check.output - check.reference)
    return Drawing(
        (
            Panel(
                label,
                axis_label(wanted.name, wanted.unit),
                (
                    Curve(*over_time(t, check.reference), "reference", style="broad"),
                    Curve(*over_time(t, check.output), "model behind its inverse", "series-1"),
                ),
            ),
            Panel(
                label, axis_label("error", wanted.unit), (Curve(*error, "", "series-6", "fine"),)
            ),
            Panel(
                label,
                axis_label(given.name, given.unit),
                (Curve(*over_time(t, check.pressure), "", "input"),),
            ),
        ),
        stacked=True,
    )


def directions(u: Array, y: Array) -> tuple[Arrow, ...]:
    """Return the direction of time amid the widest rising and the widest falling branch.

    There are none where the input jumps.

    Parameters
    ----------
    u, y : array, shape (n,)
        Input and output.
    """
    from mckibben.signals import branches

    arrows: list[Arrow] = []
    if _jumps(u):
        return ()
    found = [(abs(u[stop - 1] - u[start]), start, stop, way) for start, stop, way in branches(u)]
    for wanted in (1, -1):
        same = [branch for branch in found if branch[3] * wanted > 0]
        if not same:
            continue
        _, start, stop, _ = max(same)
        if stop - start < 4:
            continue
        a, b = (start + round(share * (stop - 1 - start)) for share in (0.45, 0.55))
        b = max(b, a + 1)
        arrows.append(Arrow((float(u[a]), float(y[a])), (float(u[b]), float(y[b]))))
    return tuple(arrows)


def _by_age(
    recording: Recording, input_name: str, output_name: str, points: int
) -> tuple[Curve, ...]:
    places, x, y = along(recording[input_name], recording[output_name], points)
    n_ages = min(N_AGES, max(1, places.size // 2))
    edges = np.linspace(0, recording.n_samples - 1, n_ages + 1)
    cuts = np.searchsorted(places, edges)
    cuts[-1] = places.size - 1
    time = recording.time
    unit = "" if recording.sample_time is None else " s"
    return tuple(
        Curve(
            x[first : last + 1],
            y[first : last + 1],
            f"{time[int(edges[age])]:.4g} to {time[int(edges[age + 1])]:.4g}{unit}",
            f"age-{age + 1}",
            _path_style(recording[input_name], _measured_style(recording)),
        )
        for age, (first, last) in enumerate(pairwise(cuts))
    )


def _measured_style(recording: Recording, under: bool = False) -> Style:
    if recording.n_samples <= FEW:
        return "beads"
    return "broad" if under else "line"


def _path_style(u: Array, style: Style) -> Style:
    return "specks" if _jumps(u) else style


def _jumps(u: Array) -> bool:
    return bool(np.median(np.abs(np.diff(u))) > JUMP * np.ptp(u))


def _first(recordings: Sequence[Recording]) -> tuple[Sequence[Recording], str]:
    if len(recordings) <= N_COLOURS:
        return recordings, ""
    others = ", ".join(recording.name for recording in recordings[N_COLOURS:])
    return recordings[:N_COLOURS], f"Not shown: {others}."


def _colours(recordings: Sequence[Recording]) -> list[tuple[str, str]]:
    if len(recordings) == 1:
        return [("", "measured")]
    return [(recording.name, series_colour(i)) for i, recording in enumerate(recordings)]


def _plane(recording: Recording, input_name: str, output_name: str) -> tuple[str, str]:
    return (
        axis_label(input_name, recording.units[input_name]),
        axis_label(output_name, recording.units[output_name]),
    )


def _worst_to_best(outputs: Outputs) -> list[tuple[str, str, Array]]:
    best = list(outputs.items())[:N_COLOURS]
    coloured = [(model, series_colour(place), y) for place, (model, y) in enumerate(best)]
    return coloured[::-1]


def _test_mark(time: Array, test_from: int | None) -> tuple[Mark, ...]:
    return () if test_from is None else (Mark(float(time[test_from]), "test"),)

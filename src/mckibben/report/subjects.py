"""Figures of recordings, and of what models make of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from mckibben.arrays import Array
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
    left_out,
    over_time,
    series_colour,
    time_label,
)

HELD_OUT = "held out to test"
"""What stands over the part of a recording that no model was fitted to."""

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
    curves = [
        Curve(*over_time(time, recording[output_name], points), recording.origin, style=under)
    ]
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
    curves = [Curve(*along(u, measured, points)[1:], recording.origin, style=under)]
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
    y_label = axis_label(f"{recording.origin} − model", recording.units[output_name])
    marks = _test_mark(recording.time, test_from)
    return Drawing(
        (
            Panel(x_label, y_label, tuple(against_input), zero=True),
            Panel(time_label(recording), y_label, tuple(against_time), marks=marks, zero=True),
        ),
        columns=2,
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
    others = [recording.name for recording in recordings[N_COLOURS:]]
    return recordings[:N_COLOURS], left_out(others)


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
    return () if test_from is None else (Mark(float(time[test_from]), HELD_OUT, float(time[-1])),)

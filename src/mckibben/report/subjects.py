"""Figures of recordings, of models on recordings, and of several muscles and loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.report.drawing import (
    FEW,
    N_AGES,
    N_COLOURS,
    POINTS,
    Arrow,
    Curve,
    Drawing,
    Label,
    Mark,
    Panel,
    Style,
    along,
    channel_label,
    jumps,
    left_out,
    over_time,
    series_colour,
    time_label,
)

HELD_OUT = "held out to test"
"""Label of the part of a recording that no model was fitted to."""

LONGEST_SEGMENT = 4096
"""Samples of a segment of a spectrum."""


def time_course(
    recordings: Sequence[Recording], channels: Sequence[str], points: int = POINTS
) -> Drawing:
    """Draw channels over time, one panel each; several recordings share the panels."""
    drawn, note = _first(recordings)
    colours = _colours(drawn)
    panels = []
    for channel in channels:
        curves = []
        for recording, (name, colour) in zip(drawn, colours, strict=True):
            t, y = over_time(recording.time, recording[channel], points)
            name = name if channel == channels[0] else ""
            curves.append(Curve(t, y, name, colour, _measured_style(recording)))
        panels.append(Panel(time_label(drawn[0]), channel_label(drawn[0], channel), tuple(curves)))
    return Drawing(tuple(panels), stacked=True, note=note)


def spectrum(recordings: Sequence[Recording], channels: Sequence[str]) -> Drawing:
    """Draw the power density of channels over frequency, by Welch's method, one panel each."""
    from scipy.signal import welch

    drawn, note = _first(recordings)
    panels = []
    for channel in channels:
        curves = []
        for recording, (name, colour) in zip(drawn, _colours(drawn), strict=True):
            n = min(recording.n_samples, LONGEST_SEGMENT)
            frequency, density = welch(recording[channel], 1.0 / recording.step, nperseg=n)
            level = 10 * np.log10(np.maximum(density[1:], np.finfo(float).tiny))
            name = name if channel == channels[0] else ""
            curves.append(Curve(*over_time(frequency[1:], level), name, colour, "fine"))
        channel_axis = channel_label(drawn[0], channel)
        label = Label(
            f"power of {channel_axis.name}",
            f"dB of ({channel_axis.unit})²/Hz" if channel_axis.unit else "dB/Hz",
        )
        panels.append(Panel(Label("frequency", "Hz"), label, tuple(curves)))
    return Drawing(tuple(panels), stacked=True, note=note)


def loop(
    recordings: Sequence[Recording],
    input_name: str,
    output_name: str,
    points: int = POINTS,
    symbols: Mapping[str, str] | None = None,
) -> Drawing:
    """Draw the output over the input: a single recording coloured by time, several by recording."""
    drawn, note = _first(recordings)
    x_label, y_label = (
        channel_label(drawn[0], name, symbols) for name in (input_name, output_name)
    )
    arrows = directions(drawn[0][input_name], drawn[0][output_name])
    if len(drawn) == 1:
        curves = _by_age(drawn[0], input_name, output_name, points)
    else:
        curves = tuple(
            Curve(
                *along(recording[input_name], recording[output_name], points)[1:],
                name,
                colour,
                _path_style(recording[input_name], _measured_style(recording)),
            )
            for recording, (name, colour) in zip(drawn, _colours(drawn), strict=True)
        )
    return Drawing((Panel(x_label, y_label, curves, arrows=arrows),), note=note)


def against(
    kind: str,
    recording: Recording,
    pair: tuple[str, str],
    outputs: Mapping[str, Array],
    test_from: int | None = None,
    points: int = POINTS,
    symbols: Mapping[str, str] | None = None,
) -> Drawing:
    """Draw the free runs of models with a recording.

    Parameters
    ----------
    kind : {"fit", "loops", "residuals"}
        Outputs over time; over the input; or measured less modelled ones over both.
    recording : Recording
    pair : (str, str)
        Input and output.
    outputs : mapping of str to array, shape (n,)
        Model name to its output, the best first, which is drawn last.
    test_from : int, optional
        First sample that is held out.
    points : int
        Of a curve.
    symbols : mapping of str to str, optional
        Of channels, as in the models' equations.
    """
    u, y = recording[pair[0]], recording[pair[1]]
    residual = kind == "residuals"
    signals = _residuals(y, outputs) if residual else _signals(recording, y, outputs)
    label = channel_label(recording, pair[1], symbols)
    if residual:
        label = Label(f"{recording.origin} − model", label.unit)
    least = 1e-6 * float(np.ptp(y))
    panels = []
    if kind != "fit":
        paths = tuple(
            replace(signal, x=x, y=v, style=_path_style(u, signal.style))
            for signal in signals
            for _, x, v in [along(u, signal.y, points)]
        )
        x_label = channel_label(recording, pair[0], symbols)
        arrows = () if residual else directions(u, y)
        panels.append(Panel(x_label, label, paths, arrows=arrows, zero=residual, least=least))
    if kind != "loops":
        t = recording.time
        courses = tuple(
            replace(signal, x=x, y=v, name="" if residual else signal.name)
            for signal in signals
            for x, v in [over_time(t, signal.y, points)]
        )
        marks = () if test_from is None else (Mark(float(t[test_from]), HELD_OUT, float(t[-1])),)
        x_label = time_label(recording)
        panels.append(Panel(x_label, label, courses, marks=marks, zero=residual, least=least))
    return Drawing(tuple(panels), abreast={"fit": 1, "residuals": 2}.get(kind, 3))


def _signals(recording: Recording, y: Array, outputs: Mapping[str, Array]) -> list[Curve]:
    """Return the measured output, and over it those of models, the best last; x is not set yet."""
    under = _measured_style(recording, under=True)
    models = [*enumerate(outputs.items())][:N_COLOURS][::-1]
    return [
        Curve(y, y, recording.origin, "measured", under),
        *(Curve(v, v, name, series_colour(k), "line", name) for k, (name, v) in models),
    ]


def _residuals(y: Array, outputs: Mapping[str, Array]) -> list[Curve]:
    """Return the measured output less those of models, the best last; x is not set yet."""
    models = [*enumerate(outputs.items())][:N_COLOURS][::-1]
    return [Curve(y - v, y - v, name, series_colour(k), "fine", name) for k, (name, v) in models]


def directions(u: Array, y: Array) -> tuple[Arrow, ...]:
    """Return the direction of time in the middle of the widest rising and falling branch.

    There are none where the input jumps.

    Parameters
    ----------
    u, y : array, shape (n,)
        Input and output.
    """
    from mckibben.signals import branches

    arrows: list[Arrow] = []
    if jumps(u):
        return ()
    branches_by_width = [
        (abs(u[stop - 1] - u[start]), start, stop, way) for start, stop, way in branches(u)
    ]
    for direction in (1, -1):
        same = [branch for branch in branches_by_width if branch[3] * direction > 0]
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
    return "specks" if jumps(u) else style


def _first(recordings: Sequence[Recording]) -> tuple[Sequence[Recording], str]:
    others = [recording.name for recording in recordings[N_COLOURS:]]
    return recordings[:N_COLOURS], left_out(others)


def _colours(recordings: Sequence[Recording]) -> list[tuple[str, str]]:
    if len(recordings) == 1:
        return [("", "measured")]
    return [(recording.name, series_colour(i)) for i, recording in enumerate(recordings)]

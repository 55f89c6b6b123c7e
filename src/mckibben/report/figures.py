"""Registry of figures: the drawing function of each kind, for `plot`, `interactive`, print and pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from inspect import signature
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.equations import channel_symbols
from mckibben.blocks.ranges import known_ranges
from mckibben.channels import Channels, any_moves, channels_of
from mckibben.control.loop import reachable_ranges
from mckibben.diagnosis.coupling import coupling
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording
from mckibben.report import (
    model_subjects,
    printed,
    subjects,
)
from mckibben.report.drawing import Curve, Drawing, Panel, axis_label, left_out
from mckibben.report.modelled_runs import (
    MOST_RECORDINGS,
    ModelledRun,
    each_recording_once,
    runs_of_study,
)
from mckibben.signals import decaying_triangle
from mckibben.system.extras import demand
from mckibben.system.showing import DrawsItself

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.control import Tracked
    from mckibben.diagnosis.characterization import Characterization
    from mckibben.diagnosis.check import Validation
    from mckibben.diagnosis.review import Review
    from mckibben.rigs.rig import Rig
    from mckibben.simulation import Simulation
    from mckibben.studying.study import Study

T = TypeVar("T")

Recordings = Recording | Sequence[Recording]

Columns = Literal[1, 2]
"""Of a journal, that a figure is as wide as."""

SCREEN = 6.4 / printed.COLUMN
"""Size of a figure of pyplot over that for print."""

PERIOD, CYCLES, SAMPLE_TIME = 10.0, 3, 0.02
"""Of the falling triangle that loops of models and rigs are drawn with [s]."""


def draw(thing: Any, kind: str | None = None, **choices: Any) -> Drawing:
    """Return a figure of an object.

    Parameters
    ----------
    thing : object
        What has a name in `FIGURES` as its ``face``, or a sequence of recordings.
    kind : str, optional
        One of its figures; default the first, or that which compares it with a ``recording``.
    **choices
        What the figure takes.

    Raises
    ------
    ModelError
        On an unknown kind, or a choice that the figure does not take.
    """
    if kind is not None and not isinstance(kind, str):
        problem = f"a kind of figure is a text, and this is {type(kind).__name__}"
        raise ModelError(problem, remedy="name what is drawn with it, as in `recording=RUN`")
    thing = thing.drawn if isinstance(thing, DrawsItself) else thing
    figures = FIGURES.get(getattr(thing, "face", "recording"), {})
    if kind is None and "recording" in choices and "loops" in figures:
        kind = "loops"
    elif kind is None and isinstance(thing, Recording) and pair_of(thing) is None:
        kind = "loop" if {"input", "output"} <= choices.keys() else "time"
    kind = kind or next(iter(figures), "")
    if kind not in figures:
        remedy = f"use one of {', '.join(figures)}" if figures else "use to_dict(), or to_frame()"
        raise ModelError(f"there is no figure {kind!r}", remedy=remedy)
    parameters = [*signature(figures[kind]).parameters][1:]
    if unknown := choices.keys() - set(parameters):
        raise ModelError(
            f"the figure {kind!r} takes no {', '.join(sorted(unknown))}",
            remedy=f"it takes {', '.join(parameters) or 'no choices'}; "
            f"other figures: {', '.join(figures)}",
        )
    return figures[kind](thing, **choices)


def write_figure(
    thing: Any,
    path: str | Path,
    kind: str | None = None,
    *,
    width: Columns | None = None,
    **choices: Any,
) -> None:
    """Write a figure for print, as `draw` makes it.

    Parameters
    ----------
    thing : object
        A recording, recordings, a model, a leaderboard, a study or another thing that is drawn.
    path : path
        File to write, ``.png``, ``.svg`` or ``.pdf``.
    kind : str, optional
        Which figure: see `FIGURES`.
    width : {1, 2}, optional
        One column of a journal, 88 mm, or two, 180 mm. Default: one, or two for panels side by
        side.
    **choices
        What the figure takes.

    Raises
    ------
    DataError
        On absent channels, another suffix, or a folder that does not exist.
    ModelError
        On an unknown kind, or where there is nothing to draw.
    """
    printed.save(draw(thing, kind, **choices), path, width)


def plot(thing: Any, kind: str | None, ax: Any, choices: Mapping[str, Any]) -> Axes | list[Axes]:
    """Draw a figure with matplotlib; see `DrawsItself.plot`."""
    demand("matplotlib", "figures", "plots")
    from matplotlib import pyplot, rc_context

    choices = dict(choices)
    width = choices.pop("width", None)
    drawing = draw(thing, kind, **choices)
    with rc_context({"text.parse_math": False} if width is None else dict(printed.STYLE)):
        axes = [] if ax is None else list(np.ravel(np.asarray(ax, dtype=object)))
        if not axes:
            scale = SCREEN if width is None else 1.0
            axes = printed.draw_on(pyplot.figure(layout="constrained"), drawing, width, scale)
        elif len(axes) == len(drawing.panels):
            printed.draw_into(axes, drawing)
        else:
            raise DataError(
                f"the figure has {len(drawing.panels)} panels, and there are {len(axes)} axes",
                remedy="pass as many as `ax=[...]`, or none for a new figure",
            )
    return axes[0] if len(axes) == 1 else axes


def pair_of(recording: Recording) -> tuple[str, str] | None:
    """Return the first pair of varying input and output, or None."""
    try:
        pairs = channels_of([recording]).pairs
    except DataError:
        return None
    return next((pair for pair in pairs if all(any_moves([recording], (x,)) for x in pair)), None)


# --- Recordings and rigs ----------------------------------------------------------------------------


def _time(
    recordings: Recordings,
    channels: Sequence[str] = (),
    input: str | None = None,  # noqa: A002
    output: str | None = None,
) -> Drawing:
    """Draw channels over time, one panel each; by default all."""
    runs = _as_sequence(recordings)
    names = [name for name in (input, output) if name is not None]
    return subjects.time_course(runs, channels or names or [*runs[0].channels])


def _spectrum(recordings: Recordings, channels: Sequence[str] = ()) -> Drawing:
    """Draw the power density of channels over frequency; by default of all."""
    runs = _as_sequence(recordings)
    if any(run.sample_time is None for run in runs):
        raise DataError("a spectrum needs a sample time", remedy="give `sample_time` in reading")
    return subjects.spectrum(runs, channels or [*runs[0].channels])


def _loop(
    recordings: Recordings,
    input: str | None = None,  # noqa: A002
    output: str | None = None,
) -> Drawing:
    """Draw the output over the input, coloured by time."""
    runs = _as_sequence(recordings)
    pair = pair_of(runs[0])
    if pair is None and not (input and output):
        raise DataError("no channels of a loop are known by name", remedy="name `input`, `output`")
    driving, driven = pair or ("", "")
    return subjects.loop(runs, input or driving, output or driven)


def _as_sequence(recordings: Recordings) -> Sequence[Recording]:
    return [recordings] if isinstance(recordings, Recording) else recordings


def _triangle(
    name: str,
    name_of_input: str,
    ends: tuple[float, float],
    others: Mapping[str, float],
    step: float = SAMPLE_TIME,
    units: Mapping[str, str] | None = None,
) -> Recording:
    """Return a decreasing triangle of one input, with the other inputs constant."""
    t = step * np.arange(round(CYCLES * PERIOD / step) + 1)
    channels = {other: np.full(t.size, value) for other, value in others.items()}
    channels[name_of_input] = decaying_triangle(t, period=PERIOD, low=ends[0], high=ends[1])
    return Recording(channels, step, units or {}, meta={"name": name})


def _of_rig(draw_recordings: Callable[..., Drawing]) -> Callable[..., Drawing]:
    """Return the drawing function of a rig's loop for a decreasing triangle, other inputs at rest."""

    def draw_rig(
        rig: Rig,
        input: str | None = None,  # noqa: A002
        output: str | None = None,
    ) -> Drawing:
        driven, resting = input or rig.inputs[0], dict(zip(rig.inputs, rig.resting[0], strict=True))
        ends = rig.limits(driven).low, rig.limits(driven).high
        run = rig.run(_triangle(rig.name, driven, ends, resting))
        measured = [name for name in rig.outputs if name not in rig.inputs] or [*rig.outputs]
        pairs = Channels(tuple(rig.inputs), tuple(measured)).pairs
        paired = next(
            (output_name for input_name, output_name in pairs if input_name == driven), measured[0]
        )
        return draw_recordings([run], input=driven, output=output or paired)

    return draw_rig


# --- Models and leaderboards ------------------------------------------------------------------------


def _block_loop(
    block: Block,
    input: str | None = None,  # noqa: A002
    output: str | None = None,
    high: float | None = None,
) -> Drawing:
    """Draw the loop of a block for a decreasing triangle of one input, others at mid-range."""
    names = [channel.name for channel in block.inputs]
    driven, output_name = input or names[0], output or block.outputs[0].name
    compensated = block.forward_model if block.inverts else None
    ranges = known_ranges(block.inputs, block.known_inputs)
    ranges |= reachable_ranges(compensated, block.inputs[: block.n_driven], None)
    if driven not in ranges and high is None:
        raise ModelError(
            f"the range of {driven} that the model was identified on is not known",
            remedy="set `high=`, or a measured `recording=`",
        )
    low, top = ranges.get(driven, (0.0, 0.0))
    middle = {name: float(np.mean(ranges.get(name, (0.0, 0.0)))) for name in names}
    turns = low, top if high is None else high
    step = block.sample_time or SAMPLE_TIME
    units = {channel.name: channel.unit for channel in block.inputs}
    run = block.simulate(_triangle(block.title, driven, turns, middle, step, units))
    return subjects.loop([run], driven, output_name, symbols=channel_symbols(block))


def _against(kind: str) -> Callable[..., Drawing]:
    """Return the drawing function of free runs, of a model or a leaderboard, with recordings."""

    def draw_against(
        thing: Block | Leaderboard,
        recording: Recordings | None = None,
        input: str | None = None,  # noqa: A002
        output: str | None = None,
        models: str | Sequence[str] = (),
    ) -> Drawing:
        if recording is None:
            raise ModelError(f"{kind!r} compares with a measurement", remedy="set `recording=`")
        blocks = {"model": thing} if isinstance(thing, Block) else _blocks(thing, models)
        first_block, recordings = next(iter(blocks.values())), _as_sequence(recording)
        output_name = output or first_block.outputs[0].name
        coupled = coupling(recordings, _driving(first_block), (output_name,))
        symbols = channel_symbols(first_block)
        runs = [
            ModelledRun(
                run,
                input or coupled.pairs([run])[0][0],
                output_name,
                {name: block.simulate(run)[output_name] for name, block in blocks.items()},
                "",
                symbols=symbols,
            )
            for run in recordings[:MOST_RECORDINGS]
        ]
        return _panels_of_runs(runs, kind, [run.name for run in recordings[MOST_RECORDINGS:]])

    return draw_against


def _simulated(kind: str) -> Callable[[Simulation], Drawing]:
    """Return the drawing function of a simulation, with what was measured where anything was."""

    def draw_simulation(simulation: Simulation) -> Drawing:
        run = simulation.recording
        if kind == "time" or not simulation.metrics:
            return _time(run)
        output = next(iter(simulation.metrics))
        pair = next(name for name in run if name not in simulation.metrics), output
        return subjects.against(kind, run, pair, {"model": run[f"{output}_model"]})

    return draw_simulation


def _blocks(board: Leaderboard, models: str | Sequence[str]) -> dict[str, Block]:
    """Return the models of a leaderboard by name; by default the chosen one."""
    names = [models] if isinstance(models, str) else list(models)
    if not names and board.best is not None:
        names = [board.best.model]
    blocks = {row.model: row.block for row in board.rows if row.block is not None}
    if not names or not blocks.keys() >= set(names):
        raise ModelError(
            f"there is no model {', '.join(names) or 'chosen'} to draw",
            remedy=f"name some of {', '.join(blocks) or 'a leaderboard where a model worked'}",
            parameter="models",
        )
    return {name: blocks[name] for name in names}


def _driving(block: Block) -> tuple[str, ...]:
    """Return a model's driving inputs, without scheduling ones."""
    return tuple(channel.name for channel in block.inputs if channel.name not in block.scheduling)


def _panels_of_runs(
    runs: Sequence[ModelledRun], kind: str, undrawn: Sequence[str] = (), models: int | None = None
) -> Drawing:
    """Draw each recording in separate panels."""
    panels: list[Panel] = []
    for run in runs[:MOST_RECORDINGS]:
        drawing = run.draw(kind, models=models)
        title = run.name if len(runs) > 1 else ""
        panels += [replace(panel, title=title) for panel in drawing.panels]
    names = [*(run.name for run in runs[MOST_RECORDINGS:]), *undrawn]
    return replace(drawing, panels=tuple(panels), note=left_out(names))


# --- Studies ----------------------------------------------------------------------------------------


def _of_study(kind: str) -> Callable[[Study], Drawing]:
    """Return the drawing function of the chosen model on recordings; residuals on the test."""

    def draw_study(study: Study) -> Drawing:
        runs = runs_of_study(study)
        return _panels_of_runs(runs[:1] if kind == "residuals" else runs, kind, models=1)

    return draw_study


def _study_recordings(draw_recordings: Callable[..., Drawing]) -> Callable[[Study], Drawing]:
    """Return the drawing function of input and first output of all recordings."""

    def draw_study(study: Study) -> Drawing:
        runs = runs_of_study(study)
        return draw_recordings(
            [run.recording for run in each_recording_once(runs)],
            input=runs[0].input,
            output=runs[0].output,
        )

    return draw_study


def _inverse(study: Study) -> Drawing:
    """Draw desired and modelled output, error, and the input that the inverse computes."""
    if study.inverse is None:
        raise ModelError("no model of this study has an inverse", remedy="compare pi, mpi and gpi")
    return model_subjects.inverse_check(study.inverse.check)


# --- What was found ---------------------------------------------------------------------------------


def _cycles(measures: Characterization) -> Drawing:
    """Draw the loop width of every cycle over its amplitude."""
    if not measures.cycles:
        raise ModelError(
            "there is no whole cycle to draw", remedy="record one, from the lowest input and back"
        )
    x = np.array([cycle.amplitude for cycle in measures.cycles])
    y = np.array([cycle.width for cycle in measures.cycles])
    label = axis_label(f"amplitude of {measures.input}", measures.input_unit)
    return Drawing((Panel(label, "loop width [%]", (Curve(x, y, "", "series-1", "dots"),)),))


def _tracked(run: Tracked, output: str | None = None) -> Drawing:
    """Draw reference and motion over time."""
    name = _item_named({name: name for name in run.rmse}, output)
    return model_subjects.tracking({"achieved": run}, name)


def _of_output(draw_item: Callable[[Any], Drawing]) -> Callable[..., Drawing]:
    """Return the drawing function for results of one output."""

    def draw_output(result: Review | Validation, output: str | None = None) -> Drawing:
        return draw_item(_item_named({item.output: item for item in result.outputs}, output))

    return draw_output


def _pattern(validation: Validation, output: str | None = None, against: str = "branch") -> Drawing:
    """Draw means of an output's residual over inputs, loads, outputs or branches."""
    check = _item_named({check.output: check for check in validation.outputs}, output)
    pattern = _item_named(
        {pattern_of_check.against: pattern_of_check for pattern_of_check in check.patterns}, against
    )
    return model_subjects.pattern(check, pattern)


def _item_named(items: Mapping[str, T], name: str | None) -> T:
    """Return the item of a name; by default the first."""
    if name is not None and name not in items:
        raise DataError(f"{name!r} is not among the results", remedy=f"use {', '.join(items)}")
    return items[name or next(iter(items))]


_AGAINST = {kind: _against(kind) for kind in ("loops", "fit", "residuals")}

FIGURES: Mapping[str, Mapping[str, Callable[..., Drawing]]] = MappingProxyType(
    {
        "recording": {"loop": _loop, "time": _time, "spectrum": _spectrum},
        "rig": {"loop": _of_rig(_loop), "time": _of_rig(_time)},
        "block": {"loop": _block_loop, **_AGAINST},
        "leaderboard": {"errors": model_subjects.leaderboard, **_AGAINST},
        "simulation": {kind: _simulated(kind) for kind in ("fit", "loops", "residuals", "time")},
        "study": {
            "loops": _of_study("loops"),
            "time": _study_recordings(_time),
            "loop": _study_recordings(_loop),
            "leaderboard": lambda study: model_subjects.leaderboard(study.leaderboard),
            "fit": _of_study("fit"),
            "residuals": _of_study("residuals"),
            "inverse": _inverse,
        },
        "characterization": {"cycles": _cycles},
        "tracked": {"time": _tracked},
        "review": {"parts": _of_output(model_subjects.parts)},
        "validation": {
            "autocorrelation": _of_output(model_subjects.autocorrelation),
            "residual": _pattern,
        },
    }
)
"""Name of a thing -> name of a figure, the usual one first -> what draws it."""

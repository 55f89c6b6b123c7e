"""Figures for print, by name: of a study, of recordings, of a saved model against recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.estimators.coupled.base import driving
from mckibben.recording import Recording
from mckibben.report import model_subjects, printed, subjects
from mckibben.report.coupling_subjects import coupling
from mckibben.report.drawing import N_COLOURS, Drawing, Panel, left_out
from mckibben.report.shown import Shown, shown, unique

if TYPE_CHECKING:
    from mckibben.studying.study import Study


def time(study: Study) -> Drawing:
    """Input and output of all recordings over time."""
    return subjects.time_course(_recordings(study), _pair(study))


def loop(study: Study) -> Drawing:
    """Output over input of all recordings."""
    return subjects.loop(_recordings(study), *_pair(study))


def leaderboard(study: Study) -> Drawing:
    """Errors of all models, with the interval of the test error."""
    return model_subjects.leaderboard(study.leaderboard)


def fit(study: Study) -> Drawing:
    """Measured and modelled output over time, of the model chosen."""
    return _one_each(
        shown(study),
        lambda one: subjects.fit_over_time(one.recording, one.output, _chosen(one), one.test_from),
    )


def loops(study: Study) -> Drawing:
    """Measured and modelled loop, of the model chosen."""
    return _one_each(
        shown(study),
        lambda one: subjects.fit_loops(one.recording, one.input, one.output, _chosen(one)),
    )


def residuals(study: Study) -> Drawing:
    """Residuals of the model chosen against input and time, on the recording tested on."""
    first = shown(study)[0]
    return subjects.residuals(
        first.recording, first.input, first.output, _chosen(first), first.test_from
    )


def weights(study: Study) -> Drawing:
    """Weights over thresholds of all models that have them."""
    return model_subjects.weights(
        {row.model: row.block for row in study.leaderboard.rows if row.block is not None}
    )


def inverse(study: Study) -> Drawing:
    """Wished-for and modelled output, error, and the input that the inverse gives."""
    if study.inverse is None or study.inverse.reachable is None:
        raise ModelError(
            "no model of this study has an inverse", remedy="compare pi, mpi and gpi, which can"
        )
    return model_subjects.inverse_check(study.inverse, study.train[0].sample_time is not None)


FIGURES: Mapping[str, Callable[[Study], Drawing]] = MappingProxyType(
    {
        "time": time,
        "loop": loop,
        "leaderboard": leaderboard,
        "fit": fit,
        "loops": loops,
        "residuals": residuals,
        "weights": weights,
        "inverse": inverse,
    }
)
"""Name -> what draws it from a study."""

RECORDING_KINDS = ("time", "loop")
MODEL_KINDS = ("fit", "loops", "residuals", "weights")


def plot_recording(
    recordings: Sequence[Recording],
    input: str,  # noqa: A002
    output: str,
    kind: str,
    path: str | Path,
) -> None:
    """Write a figure of recordings.

    Parameters
    ----------
    recordings : sequence of Recording
        At least one; of more than six, the first six are drawn and the others named.
    input, output : str
        Channels.
    kind : {"time", "loop"}
        Both over time, or the output over the input.
    path : path
        File to write, ``.png``, ``.svg`` or ``.pdf``.

    Raises
    ------
    DataError
        On absent channels, another suffix, or a folder that does not exist.
    ModelError
        On an unknown kind.
    """
    if _known(kind, RECORDING_KINDS) == "time":
        drawing = subjects.time_course(recordings, (input, output))
    else:
        drawing = subjects.loop(recordings, input, output)
    printed.save(drawing, path)


def plot_model(block: Block, recordings: Sequence[Recording], kind: str, path: str | Path) -> None:
    """Write a figure of a model, running free, against recordings.

    The first output of the model is drawn, over the first input, or of several muscles over that which
    moves it most.

    Parameters
    ----------
    block : Block
        The model.
    recordings : sequence of Recording
        At least one, with the model's inputs and its measured output; of more than six, the first
        six are drawn. Each starts from the memory that best explains its first sample.
    kind : {"fit", "loops", "residuals", "weights"}
        Output over time; output over input; measured less modelled; weights over thresholds.
    path : path
        File to write, ``.png``, ``.svg`` or ``.pdf``.

    Raises
    ------
    DataError
        On absent channels, another suffix, or a folder that does not exist.
    ModelError
        On an unknown kind, a model without weights, or one that does not suit the recordings.
    """
    from mckibben.blocks.free_run import run_free

    name = "model"
    if _known(kind, MODEL_KINDS) == "weights":
        printed.save(model_subjects.weights({name: block}), path)
        return
    wanted = block.outputs[0].name
    coupled = coupling(recordings, _driving(block, recordings[0]), (wanted,))
    runs = [
        Shown(r, *coupled.pairs([r])[0], {name: run_free(block, r, wanted)}, "")
        for r in recordings[:N_COLOURS]
    ]

    def drawing(one: Shown) -> Drawing:
        if kind == "fit":
            return subjects.fit_over_time(one.recording, wanted, one.outputs)
        if kind == "loops":
            return subjects.fit_loops(one.recording, one.input, wanted, one.outputs)
        return subjects.residuals(one.recording, one.input, wanted, one.outputs)

    printed.save(_one_each(runs, drawing, [r.name for r in recordings[N_COLOURS:]]), path)


def _one_each(
    runs: Sequence[Shown], draw: Callable[[Shown], Drawing], others: Sequence[str] = ()
) -> Drawing:
    """Draw each recording in panels of its own."""
    panels: list[Panel] = []
    for one in runs[:N_COLOURS]:
        drawing = draw(one)
        title = one.name if len(runs) > 1 else ""
        panels += [replace(panel, title=title) for panel in drawing.panels]
    named = [*(one.name for one in runs[N_COLOURS:]), *others]
    return replace(drawing, panels=tuple(panels), note=left_out(named))


def _recordings(study: Study) -> list[Recording]:
    return [one.recording for one in unique(shown(study))]


def _pair(study: Study) -> tuple[str, str]:
    """Return the first output, and the input that is its own."""
    first = shown(study)[0]
    return first.input, first.output


def _chosen(one: Shown) -> dict[str, Array]:
    if not one.outputs:
        raise ModelError(
            "no model of this study worked", remedy="read the reasons in its leaderboard"
        )
    return dict(list(one.outputs.items())[:1])


def _driving(block: Block, recording: Recording) -> tuple[str, ...]:
    """Return a model's inputs, without what else it is told, as a load: no loop is drawn over that."""
    told = tuple(channel.name for channel in block.inputs)
    muscles = tuple(name for name in driving(recording) if name in told)
    return muscles if told[0] in muscles else told[:1]


def _known(name: str, names: tuple[str, ...]) -> str:
    if name not in names:
        raise ModelError(f"there is no figure {name!r}", remedy=f"use one of {', '.join(names)}")
    return name

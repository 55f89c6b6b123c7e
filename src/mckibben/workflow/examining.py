"""Examination of recordings and models: info, characterize, data_gaps, check, calibrate, and so on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from mckibben.errors import ModelError
from mckibben.files.memory import Data, items
from mckibben.keywords import (
    CalibrateKeywords,
    ChannelKeywords,
    CharacterizeKeywords,
    PlanKeywords,
    PlotKeywords,
    ReadKeywords,
    ReproduceKeywords,
    ReviewKeywords,
    SimulateKeywords,
)
from mckibben.options import (
    FILES,
    MODEL,
    Argument,
    CalibrateOptions,
    ChannelOptions,
    CharacterizeOptions,
    Option,
    PlanOptions,
    PlotOptions,
    ReadOptions,
    ReproduceOptions,
    ReviewOptions,
    SimulateOptions,
    given_options,
)
from mckibben.reading import files_of, loaded, read_files, read_loop, read_sides
from mckibben.recording import Recording, reading_notes
from mckibben.system.progress import telling
from mckibben.workflow.operation import (
    Progress,
    claimed,
    operation,
    options_of,
    paths,
    saved,
    unread,
)

if TYPE_CHECKING:
    from mckibben.diagnosis.bands import Calibration
    from mckibben.diagnosis.characterization import Characterization
    from mckibben.diagnosis.check import Validation
    from mckibben.diagnosis.data_gaps import Gap
    from mckibben.diagnosis.review import Review
    from mckibben.papers.experiment import Reproduction
    from mckibben.planning.planner import Plan
    from mckibben.reading import Contents
    from mckibben.simulation import Simulation
    from mckibben.workflow.operation import Model


def info(
    data: Data,
    options: ChannelOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    **keywords: Unpack[ChannelKeywords],
) -> Contents:
    """Return what is in recordings: columns, channels with units and ranges, and data gaps.

    Parameters
    ----------
    data, options, reading
        See `mckibben.workflow`; options are those of `mckibben.options.ChannelOptions`.
    """
    from mckibben.reading import contents

    chosen, reading = options_of(ChannelOptions, options, reading, keywords)
    return contents(data, reading, chosen.input, chosen.output)


@operation({"data": FILES}, CharacterizeOptions)
def characterize(
    data: Data,
    options: CharacterizeOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    **keywords: Unpack[CharacterizeKeywords],
) -> Characterization:
    """Measure loop width, asymmetry, dead zone, creep and rate dependence of a muscle.

    Parameters
    ----------
    data, options, reading
        See `mckibben.workflow`; options are those of `mckibben.options.CharacterizeOptions`. What is
        measured is described in `mckibben.diagnosis.characterize`.
    """
    from mckibben.diagnosis.characterization import characterize as find

    chosen, reading = options_of(CharacterizeOptions, options, reading, keywords)
    others = tuple(chosen.scheduling)
    recordings, *pair = read_loop(data, chosen.input, chosen.output, reading, others)
    found = find(recordings, *pair, scheduling=others)
    return replace(found, notes=reading_notes(recordings))


def data_gaps(
    data: Data,
    options: ChannelOptions | None = None,
    *,
    tests: Data = (),
    reading: ReadOptions | None = None,
    **keywords: Unpack[ChannelKeywords],
) -> tuple[Gap, ...]:
    """Return the data gaps of recordings, which models cannot learn from them; most important first.

    Parameters
    ----------
    data, options, reading
        See `mckibben.workflow`; options are those of `mckibben.options.ChannelOptions`.
    tests : data
        On which a model is to be used.
    """
    from mckibben.channels import channels_of
    from mckibben.diagnosis.data_gaps import data_gaps as find

    chosen, reading = options_of(ChannelOptions, options, reading, keywords)
    words = chosen.input, chosen.output
    (runs, used), _ = read_sides(
        [data, tests], lambda some: channels_of(some, *words), words, reading
    )
    return find(runs, *words, tests=used)


@operation(
    {"model": MODEL, "data": FILES},
    out=Option("Folder for the results.", "DIR", "-o"),
    must_write=True,
    writes=("report.html", "validation.json"),
)
def check(
    model: Model,
    data: Data,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **keywords: Unpack[ReadKeywords],
) -> Validation:
    """Validate a saved model on recordings, and list the causes of its residual.

    The model is simulated in free run. Possible causes are lag, inputs, their direction (hysteresis),
    loads, time (drift), speed, holds (creep) and position. Use recordings that the model was not fitted
    to. A folder includes all recordings in it.

    Parameters
    ----------
    model : Block, Fit, or file
    data, reading, out, force, progress
        See `mckibben.workflow`.
    """
    from mckibben.diagnosis.check import check as find
    from mckibben.diagnosis.description import describe
    from mckibben.files.sources import expanded
    from mckibben.outputs import results_in
    from mckibben.report.check_page import write_check

    reading = given_options(ReadOptions, reading, keywords)
    runs: Data = [*loaded(data), *expanded([], files_of(data))[2]]
    names = ["validation.json", "report.html"]
    with results_in(out, names, inputs=paths(model, runs), force=force, kind="check") as results:
        block = saved(model)
        needed = dict.fromkeys(channel.name for channel in (*block.inputs, *block.outputs))
        recordings = read_files(runs, list(needed), reading)
        found = find(block, recordings, progress=progress)
        found = replace(found, description=describe(block, recordings, fitted=False))
        if results is not None:
            write_check(results, found, next(map(str, paths(model)), block.title))
            results.commit()
    return found


@operation(
    {"model": MODEL, "data": FILES},
    CalibrateOptions,
    out=Option("Model with its band to write (JSON).", "FILE", "-o"),
    must_write=True,
)
def calibrate(
    model: Model,
    data: Data,
    options: CalibrateOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **keywords: Unpack[CalibrateKeywords],
) -> Calibration:
    """Calibrate a prediction band of a model on recordings that it was not fitted to.

    On average, a band of level 0.9 contains 90 % of the samples of a similar new recording. `simulate`
    with an interval of 0.9 computes its lower and upper limits.

    Parameters
    ----------
    model : Block, Fit, or file
    data, options, reading, out, force, progress
        See `mckibben.workflow`; options are those of `mckibben.options.CalibrateOptions`.
    """
    from mckibben.diagnosis.bands import calibrate as find

    chosen, reading = options_of(CalibrateOptions, options, reading, keywords)
    file = claimed(out, paths(model, *files_of(data), *files_of(chosen.fitted)), force)
    fitted = read_files(chosen.fitted, None, reading)
    block, runs = saved(model), read_files(data, None, reading)
    found = find(block, runs, exchangeable=chosen.exchangeable, fitted=fitted, progress=progress)
    if file is not None:
        found.model.save(file)
    return found


@operation(
    {"model": MODEL, "data": Argument("FILE", "Recording with the model's inputs.")},
    SimulateOptions,
    out=Option("File to write (.csv).", "FILE", "-o"),
    must_write=True,
)
def simulate(
    model: Model,
    data: Data,
    options: SimulateOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    **keywords: Unpack[SimulateKeywords],
) -> Simulation:
    """Simulate a saved model in free run on a recording; adds channels named OUTPUT_model.

    The run begins from the first measured output for what that determines, and at rest for the rest;
    without measured outputs, or if that is asked for, at rest at the first input.

    Parameters
    ----------
    model : Block, Fit, Inverse, or file
    data, options, reading, out, force
        See `mckibben.workflow`; options are those of `mckibben.options.SimulateOptions`.
    """
    from mckibben.files import write
    from mckibben.studying.simulating import simulated

    chosen, reading = options_of(SimulateOptions, options, reading, keywords)
    file = claimed(out, [*paths(model), *files_of(data)], force, recording=True)
    found = simulated(
        saved(model, chosen.fields),
        lambda names: read_files(data, names, reading),
        initial=None if chosen.initial == "measured" else chosen.initial,
        interval=chosen.interval,
    )
    if file is not None:
        write(found.recording.with_meta(model=", ".join(map(str, paths(model)))), file)
    return found


@operation(
    {"data": Argument("[FILES]...", "What has been recorded; also of a plan before.", True)},
    PlanOptions,
    out=Option("File to write (.csv).", "FILE", "-o"),
    must_write=True,
)
def plan(
    data: Data = (),
    options: PlanOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    **keywords: Unpack[PlanKeywords],
) -> Plan:
    """Design the next experiment: random motion within limits, and segments that close data gaps.

    The motion starts and ends at rest.

    Parameters
    ----------
    data, options, reading, out, force
        See `mckibben.workflow`; options are those of `mckibben.options.PlanOptions`.
    """
    from mckibben.files import write
    from mckibben.planning.planner import plan as make

    chosen, reading = options_of(PlanOptions, options, reading, keywords)
    arguments = {one.name: getattr(chosen, one.name) for one in fields(chosen)}
    if not items(data):
        unread(reading, "a plan without recordings is one of a rig")
    file = claimed(out, paths(data, chosen.rig), force, recording=True)
    found = make(read_files(data, None, reading), **arguments)
    if file is not None:
        write(found.recording, file)
    return found


@operation({"log": FILES}, ReviewOptions)
def review(
    log: Data,
    options: ReviewOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    **keywords: Unpack[ReviewKeywords],
) -> Review:
    """Review the log of a closed loop: tracking error and its causes, and a refit of the model.

    The log has a reference (reference_displacement, setpoint, ...); one of model and compensator is
    enough.

    Parameters
    ----------
    log, options, reading
        See `mckibben.workflow`; options are those of `mckibben.options.ReviewOptions`.
    """
    from mckibben.diagnosis.review import review as find

    chosen, reading = options_of(ReviewOptions, options, reading, keywords)
    ran = {"model": saved(chosen.model), "compensator": saved(chosen.compensator)}
    recordings = read_files(log, None, reading)
    return find(recordings, refit=chosen.refit, seed=chosen.seed, **ran)


@operation(
    {"data": FILES},
    PlotOptions,
    out=Option("Figure to write: .png, .svg or .pdf.", "FILE", "-o"),
    must_write=True,
)
def plot(
    data: Any,
    options: PlotOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    **keywords: Unpack[PlotKeywords],
) -> Any:
    """Plot recordings, or a saved model and recordings, for publication.

    Parameters
    ----------
    data : data, or a result or a model
        What has a ``plot`` of its own is drawn by that.
    options, reading, out, force
        See `mckibben.workflow`; options are those of `mckibben.options.PlotOptions`.

    Returns
    -------
    Axes, or list of Axes, or None
        Of matplotlib; None where the figure was written.
    """
    from mckibben.report.figures import plot as draw
    from mckibben.report.figures import write_figure
    from mckibben.report.printed import format_of

    chosen, reading = options_of(PlotOptions, options, reading, keywords)
    if out is not None:
        format_of(Path(out))  # another ending is refused now
    file = claimed(out, paths(data, chosen.model), force)
    choices: dict[str, Any] = {}
    thing, kind = data, chosen.kind
    own = hasattr(data, "face") and not isinstance(data, Recording)
    if own:
        unread(reading, "a result is drawn")
    for name in ("input", "output", *(["model"] if own else [])):
        if getattr(chosen, name) is not None and (own or chosen.model is not None):
            problem = "a model, or a result, has its own"
            raise ModelError(problem, parameter=name, remedy="leave it out")
    if not own and chosen.model is None:
        recordings, given, moved = read_loop(data, chosen.input, chosen.output, reading)
        thing, choices = recordings, {"input": given, "output": moved}
    elif not own:
        thing, kind = saved(chosen.model), kind or "fit"
        needed = [channel.name for channel in (*thing.inputs, *thing.outputs)]
        choices = {"recording": read_files(data, needed, reading)}
    choices["width"] = chosen.width
    if file is None:
        return draw(thing, kind, None, choices)
    write_figure(thing, file, kind, **choices)
    return None


def reproduce(
    paper: str,
    options: ReproduceOptions | None = None,
    *,
    data: str | Path | None = None,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    recognised: Callable[[Any], None] | None = None,
    command: str = "",
    **keywords: Unpack[ReproduceKeywords],
) -> Reproduction:
    """Run a paper's protocol on its rig, with its methods and ours, and compare the tables.

    Parameters
    ----------
    paper : str
        Short name.
    data : path, optional
        Folder with recordings of the paper's runs, of any size and name, instead of the rig's.
    recognised : callable, optional
        Called with the table of which run each recording is, before anything is fitted.
    command : str
        That repeats it, for the report; default that on the paper's rig.
    options, reading, out, force, progress
        See `mckibben.workflow`; options are those of `mckibben.options.ReproduceOptions`.
    """
    from mckibben.report.rerun import rerun

    chosen, reading = options_of(ReproduceOptions, options, reading, keywords)
    if data is None:
        unread(reading, "the rig is recorded")
    with telling(progress, paper, lines=True) as tell:
        return rerun(
            paper,
            None if data is None else Path(data),
            reading,
            rig=chosen.rig,
            out=None if out is None else Path(out),
            quick=chosen.quick,
            seed=chosen.seed,
            jobs=chosen.jobs,
            force=force,
            progress=tell,
            recognised=recognised,
            command=command,
        )

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
    claim_output,
    load_model,
    operation,
    options_of,
    paths,
    refuse_reading,
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

    options, reading = options_of(ChannelOptions, options, reading, keywords)
    return contents(data, reading, options.input, options.output)


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
    from mckibben.diagnosis.characterization import characterize as measure

    options, reading = options_of(CharacterizeOptions, options, reading, keywords)
    scheduling = tuple(options.scheduling)
    recordings, *names = read_loop(data, options.input, options.output, reading, scheduling)
    characterization = measure(recordings, *names, scheduling=scheduling)
    return replace(characterization, notes=reading_notes(recordings))


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
    from mckibben.diagnosis.data_gaps import data_gaps as find_gaps

    options, reading = options_of(ChannelOptions, options, reading, keywords)
    words = options.input, options.output
    (runs, test_runs), _ = read_sides(
        [data, tests], lambda some: channels_of(some, *words), words, reading
    )
    return find_gaps(runs, *words, tests=test_runs)


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
    from mckibben.diagnosis.check import check as validate
    from mckibben.diagnosis.description import describe
    from mckibben.files.sources import expanded
    from mckibben.outputs import results_in
    from mckibben.report.check_page import write_check

    reading = given_options(ReadOptions, reading, keywords)
    runs: Data = [*loaded(data), *expanded([], files_of(data))[2]]
    names = ["validation.json", "report.html"]
    with results_in(out, names, inputs=paths(model, runs), force=force, kind="check") as results:
        block = load_model(model)
        needed = dict.fromkeys(channel.name for channel in (*block.inputs, *block.outputs))
        recordings = read_files(runs, list(needed), reading)
        validation = validate(block, recordings, progress=progress)
        validation = replace(validation, description=describe(block, recordings, fitted=False))
        if results is not None:
            write_check(results, validation, next(map(str, paths(model)), block.title))
            results.commit()
    return validation


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
    from mckibben.diagnosis.bands import calibrate as calibrate_band

    options, reading = options_of(CalibrateOptions, options, reading, keywords)
    file = claim_output(out, paths(model, *files_of(data), *files_of(options.fitted)), force)
    fitted = read_files(options.fitted, None, reading)
    block, runs = load_model(model), read_files(data, None, reading)
    calibration = calibrate_band(
        block, runs, exchangeable=options.exchangeable, fitted=fitted, progress=progress
    )
    if file is not None:
        calibration.model.save(file)
    return calibration


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
    from mckibben.studying.simulating import simulate_recording

    options, reading = options_of(SimulateOptions, options, reading, keywords)
    file = claim_output(out, [*paths(model), *files_of(data)], force, recording=True)
    simulation = simulate_recording(
        load_model(model, options.fields),
        lambda names: read_files(data, names, reading),
        initial=None if options.initial == "measured" else options.initial,
        interval=options.interval,
    )
    if file is not None:
        write(simulation.recording.with_meta(model=", ".join(map(str, paths(model)))), file)
    return simulation


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
    from mckibben.planning.planner import plan as design_experiment

    options, reading = options_of(PlanOptions, options, reading, keywords)
    arguments = {option.name: getattr(options, option.name) for option in fields(options)}
    if not items(data):
        refuse_reading(reading, "a plan without recordings is one of a rig")
    file = claim_output(out, paths(data, options.rig), force, recording=True)
    experiment = design_experiment(read_files(data, None, reading), **arguments)
    if file is not None:
        write(experiment.recording, file)
    return experiment


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
    from mckibben.diagnosis.review import review as review_log

    options, reading = options_of(ReviewOptions, options, reading, keywords)
    blocks = {"model": load_model(options.model), "compensator": load_model(options.compensator)}
    recordings = read_files(log, None, reading)
    return review_log(recordings, refit=options.refit, seed=options.seed, **blocks)


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

    options, reading = options_of(PlotOptions, options, reading, keywords)
    if out is not None:
        format_of(Path(out))  # another ending is refused now
    file = claim_output(out, paths(data, options.model), force)
    subject, kind, choices = _plotted(data, options, reading)
    if file is None:
        return draw(subject, kind, None, choices)
    write_figure(subject, file, kind, **choices)
    return None


def _plotted(
    data: Any, options: PlotOptions, reading: ReadOptions
) -> tuple[Any, str | None, dict[str, Any]]:
    """Return what is plotted, the kind of plot and its settings.

    That is a result or a model in memory, the recordings in data, or a saved model on these.
    """
    subject, kind = data, options.kind
    choices: dict[str, Any] = {}
    is_result = hasattr(data, "face") and not isinstance(data, Recording)
    if is_result:
        refuse_reading(reading, "a result is drawn")
    for name in ("input", "output", *(["model"] if is_result else [])):
        if getattr(options, name) is not None and (is_result or options.model is not None):
            problem = "a model, or a result, has its own"
            raise ModelError(problem, parameter=name, remedy="leave it out")
    if not is_result and options.model is None:
        recordings, driving, driven = read_loop(data, options.input, options.output, reading)
        subject, choices = recordings, {"input": driving, "output": driven}
    elif not is_result:
        subject, kind = load_model(options.model), kind or "fit"
        names = [channel.name for channel in (*subject.inputs, *subject.outputs)]
        choices = {"recording": read_files(data, names, reading)}
    return subject, kind, {**choices, "width": options.width}


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

    options, reading = options_of(ReproduceOptions, options, reading, keywords)
    if data is None:
        refuse_reading(reading, "the rig is recorded")
    with telling(progress, paper, lines=True) as tell:
        return rerun(
            paper,
            None if data is None else Path(data),
            reading,
            rig=options.rig,
            out=None if out is None else Path(out),
            quick=options.quick,
            seed=options.seed,
            jobs=options.jobs,
            force=force,
            progress=tell,
            recognised=recognised,
            command=command,
        )

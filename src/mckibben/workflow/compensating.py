"""Compensation: `invert` a model, `track` a reference, `learn` from repetitions, and `export` code."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

from mckibben.errors import DataError, ModelError
from mckibben.files.memory import Data
from mckibben.keywords import (
    AnyExportKeywords,
    InvertKeywords,
    LearnKeywords,
    TrackKeywords,
)
from mckibben.options import (
    COMPENSATOR,
    FILES,
    MODEL,
    Argument,
    COptions,
    ExportOptions,
    FMUOptions,
    InvertOptions,
    LearnOptions,
    MJCFOptions,
    Option,
    ReadOptions,
    TrackOptions,
    given_options,
)
from mckibben.reading import files_of, only, read_files
from mckibben.recording import COMMAND, Recording, sample_time_of
from mckibben.studying.results import Exported, Inverse, Tracking
from mckibben.system.progress import Tell, telling
from mckibben.system.threads import one_blas_thread
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
    from mckibben.blocks.base import Block
    from mckibben.control import Controller, Learned
    from mckibben.control.connecting import Plant
    from mckibben.workflow.operation import Model


@operation(
    {"model": MODEL},
    InvertOptions,
    out=Option("Inverse to write (JSON).", "FILE", "-o"),
    must_write=True,
)
def invert(
    model: Model,
    options: InvertOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **keywords: Unpack[InvertKeywords],
) -> Inverse:
    """Return the inverse of a model, with the desired output as input.

    The inverse of a force model computes the pressure from the desired force and the length. One that is
    wanted for force estimates it from measured displacements and pressures. An adaptive one also has
    the measured outputs as inputs, and adapts its parameters while it runs.

    Parameters
    ----------
    model : Block, Fit, or file
    options, reading, out, force, progress
        See `mckibben.workflow`; options are those of `mckibben.options.InvertOptions`.
    """
    options, reading = options_of(InvertOptions, options, reading, keywords)
    options.check()
    file = claim_output(out, paths(model, options.learned), force)
    if not options.learned:
        refuse_reading(reading, "an inverse is learned from recordings only with `learned`")
        if options.seed:
            problem = "nothing is random without `learned`"
            raise ModelError(problem, parameter="seed", remedy="leave it out")
    inverse = _inverse_of_kind(load_model(model, options.fields), options, reading, progress)
    if file is not None:
        inverse.model.save(file)
    return replace(inverse, file=file)


def _inverse_of_kind(
    block: Block, options: InvertOptions, reading: ReadOptions | None, progress: Progress
) -> Inverse:
    """Return the inverse that is asked for: learned, predictive, of the force, adaptive or exact."""
    from mckibben.blocks.coupled.load_estimate import load_of
    from mckibben.blocks.predictive import Predictive
    from mckibben.estimators.coupled.sdchm import trained_inverse
    from mckibben.studying.inverting import build_compensator

    if options.learned:
        runs = read_files(options.learned, None, reading)
        with one_blas_thread(), telling(progress, "learning the inverse") as tell:
            learned, rmse = trained_inverse(block, runs, options.seed, tell)
        return Inverse(learned, "learned", rmse=rmse)
    if options.predictive:
        predictive = Predictive(build_compensator(block), **options.of_predictive())
        return Inverse(predictive, "predictive")
    if options.wanted == "force":
        if all(channel.name.startswith("force") for channel in block.outputs):
            return Inverse(block, "itself")
        return Inverse(load_of(block), "force")
    return _adaptive_or_exact_inverse(block, options)


def _adaptive_or_exact_inverse(block: Block, options: InvertOptions) -> Inverse:
    """Return an inverse from desired outputs to inputs, with the outputs that it reaches."""
    from mckibben.blocks.adaptive import adaptive
    from mckibben.blocks.coupled.load_estimate import ForceCompensator
    from mckibben.blocks.fields import drives
    from mckibben.blocks.force.feedforward import ForceFeedforward
    from mckibben.studying.inverting import build_compensator

    if not options.adaptive:
        if ForceFeedforward.of(block) or ForceCompensator.of(block):
            return Inverse(build_compensator(block), "feedforward")
        if not block.inverts and drives(block.outputs[0]) and not drives(block.inputs[0]):
            return Inverse(block, "itself")
    inverse, kind = build_compensator(block), "inverse"
    if options.adaptive:
        time = 60.0 if options.time is None else options.time
        inverse, kind = adaptive(block, time, options.noise), "adaptive"
    limits = [(float(low), float(high)) for low, high in zip(*block.reachable(), strict=True)]
    finite = all(math.isfinite(end) for pair in limits for end in pair)
    names = [channel.name for channel in block.outputs]
    return Inverse(inverse, kind, dict(zip(names, limits, strict=True)) if finite else {})


@operation(
    {
        "compensator": COMPENSATOR,
        "reference": Option("Displacements, or force, to follow.", "FILE"),
    },
    TrackOptions,
    out=Option("Recording of the run to write.", "FILE", "-o"),
)
def track(
    compensator: Model,
    reference: Data,
    options: TrackOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **keywords: Unpack[TrackKeywords],
) -> Tracking:
    """Track a reference with a compensator or a controller on a virtual rig or on a model.

    The result is compared with a static map: through the middle of a slow loop of the same plant.

    Parameters
    ----------
    compensator : Block, Inverse, or file
    reference : Recording, or file
        Displacements, or force, to follow.
    options, reading, out, force, progress
        See `mckibben.workflow`; options are those of `mckibben.options.TrackOptions`.
    """
    from mckibben.blocks.base import Block
    from mckibben.control import BlockController, before
    from mckibben.control import track as close_loop
    from mckibben.control.connecting import flatters_feedback, kind_of, offer_of, reference_for
    from mckibben.files import write
    from mckibben.studying.recorded_inputs import beyond_known

    options, reading = options_of(TrackOptions, options, reading, keywords)
    read = paths(compensator, reference, options.rig, options.plant)
    file = claim_output(out, read, force, recording=True)
    controller_file = claim_output(options.controller_out, [*read, *paths(out)], force)

    block, plant = load_model(compensator, options.fields), _plant(options, reading)
    _require_compensator(block)
    desired = reference_for(plant, only(read_files(reference, None, reading)), block)
    BlockController(block).connect(offer_of(plant, desired))  # before anything is tuned
    make_law, settings = _law_of(block, plant, desired, options), _loop_settings(block, options)

    with telling(progress, f"{options.controller} on {plant.name}") as tell:
        learned = None
        if options.repetitions:
            learned = _learn_from_repetitions(block, plant, desired, make_law, options, settings)
        law = make_law(learned.best if learned else block)
        if controller_file is not None:
            _require_one_block(law, block, desired, options)

        loop = settings | {"seed": options.seed}
        first_half, second_half = (_half(tell, start) for start in (0.0, 0.5))
        tracked = close_loop(
            law, plant, desired, preview=options.preview, progress=first_half, **loop
        )
        uncompensated = before(block, plant, desired, progress=second_half, **loop)

    if file is not None:
        write(uncompensated.beside(tracked.recording), file)
    if controller_file is not None and isinstance(law, Block):
        law.save(controller_file)
    return Tracking(
        tracked=tracked,
        uncompensated=uncompensated,
        plant=plant,
        plant_kind=kind_of(plant, block),
        flatters_feedback=flatters_feedback(plant, options.controller),
        law=options.controller,
        seed=options.seed,
        controller=law,
        reference=desired,
        notes=(*beyond_known(block, desired), *uncompensated.notes),
        file=file,
        controller_file=controller_file,
        learned=learned,
    )


def _require_compensator(block: Block) -> None:
    """Raise an error if a block does not drive a plant."""
    from mckibben.blocks.fields import drives

    if not any(drives(channel) for channel in block.outputs) and not _gives_commands(block):
        outputs = ", ".join(channel.name for channel in block.outputs)
        raise ModelError(
            f"its outputs are {outputs}, but a compensator's are pressures or commands",
            parameter="compensator",
            remedy="give the result of `invert()`",
        )


def _gives_commands(block: Block) -> bool:
    """Return whether a compensator's outputs are commands to a regulator, not pressures."""
    return any(channel.name.startswith(COMMAND) for channel in block.outputs)


def _loop_settings(block: Block, options: TrackOptions) -> dict[str, Any]:
    """Return the arguments of `mckibben.control.track` that options state, but for the seed.

    Commands are no pressures, which a pressure loop could compare with measured ones.
    """
    names = ("approach", "settle", "noise", "delay", "slew")
    settings: dict[str, Any] = {name: getattr(options, name) for name in names}
    return settings | {"pressure_loop": options.pressure_loop and not _gives_commands(block)}


def _law_of(
    block: Block, plant: Plant, desired: Recording, options: TrackOptions
) -> Callable[[Block], Block | Controller]:
    """Return what makes the control law of a compensator; a PID is tuned once, when it is needed."""
    from mckibben.control import control_law, tune_pid

    step = sample_time_of(desired, "be a reference")
    scheduled = {name: float(desired[name][0]) for name in plant.inputs if name in desired}

    @cache
    def tuned() -> Any:
        return tune_pid(plant, sample_time=step, scheduled=scheduled, references=block.inputs)

    return lambda compensator: control_law(options.controller, compensator, tuned)


def _preview(block: Block, options: TrackOptions) -> float:
    """Return how far ahead a compensator is given the reference [s]."""
    from mckibben.control import preview_time

    return preview_time(block) if options.preview is None else options.preview


def _learn_from_repetitions(
    block: Block,
    plant: Plant,
    desired: Recording,
    make_law: Callable[[Block], Block | Controller],
    options: TrackOptions,
    settings: dict[str, Any],
) -> Learned:
    """Return the compensator that is learned from repetitions, each with other noise."""
    from mckibben.control import learn as repeat_and_learn
    from mckibben.control import track as close_loop
    from mckibben.control.controller import samples_ahead

    step, seeds = sample_time_of(desired, "be a reference"), count(options.seed)

    def repetition(corrected: Block) -> Recording:
        law, loop = make_law(corrected), settings | {"seed": next(seeds)}
        return close_loop(law, plant, desired, preview=options.preview, **loop).recording

    return repeat_and_learn(
        block,
        repetition,
        options.repetitions,
        ahead=max(samples_ahead(_preview(block, options), step), 1) + block.samples_ahead,
        settle=round(options.approach / step) + round(options.settle / step),
    )


def _require_one_block(
    law: Block | Controller, block: Block, desired: Recording, options: TrackOptions
) -> None:
    """Raise an error if a law cannot be saved: it is no block, or feedback needs a later reference."""
    from mckibben.blocks.base import Block
    from mckibben.blocks.feedback import FeedforwardFeedback

    step = sample_time_of(desired, "be a reference")
    later = _preview(block, options) + block.samples_ahead * step > step
    if not isinstance(law, Block) or (isinstance(law, FeedforwardFeedback) and later):
        raise ModelError(
            f"{options.controller!r} cannot be saved as one block",
            parameter="controller_out",
            remedy="leave it out; or use feedforward or pid, or both with `preview=0`",
        )


@operation(
    {"compensator": Argument("COMPENSATOR", "That of the first recording (JSON)."), "runs": FILES},
    LearnOptions,
    out=Option("Compensator to run next (JSON).", "FILE", "-o"),
    must_write=True,
)
def learn(
    compensator: Model,
    runs: Data,
    options: LearnOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    **keywords: Unpack[LearnKeywords],
) -> Learned:
    """Learn from repetitions of one motion: correct the reference of a compensator by their errors.

    Record the motion with the compensator, with columns of the reference (reference_displacement) and of
    the measured output; learn; run what was written; and so on, each time with all recordings, in order.
    `track` does this on a virtual rig or a model, with ``repetitions``.

    Parameters
    ----------
    compensator : Block, Inverse, or file
        That of the first recording; ``out`` is the one to run next.
    runs : data
        All repetitions, in order; see `mckibben.control.learned`.
    options, reading, out, force
        See `mckibben.workflow`; options are those of `mckibben.options.LearnOptions`.
    """
    from mckibben.control import learned

    options, reading = options_of(LearnOptions, options, reading, keywords)
    file = claim_output(out, paths(compensator, *files_of(runs)), force)
    recordings = read_files(runs, None, reading)
    result = learned(
        load_model(compensator), recordings, ahead=options.ahead, repeats=options.repeats
    )
    if file is not None:
        (result.best if options.best else result.next).save(file)
    return result


def _half(tell: Tell | None, start: float) -> Callable[[float], None] | None:
    """Return the progress callback of one of two runs, which begins at a share of the whole."""
    return None if tell is None else lambda share: tell(start + 0.5 * share, "")


def _plant(options: TrackOptions, reading: ReadOptions | None) -> Any:
    """Return the plant of a loop: a rig, or a model as a twin of the user's muscle."""
    from mckibben.control import Twin
    from mckibben.rigs import load_rig

    rest_length = None if reading is None else reading.rest_length
    if (options.rig is None) == (options.plant is None):
        raise DataError(
            "a loop is closed on one plant",
            remedy="give `plant=model.json`, a model of your own muscle, or `rig=NAME`",
        )
    if options.rig is not None:
        for name, value in (("limits", options.limits), ("rest_length", rest_length)):
            if value:
                raise DataError("a rig has its own", parameter=name, remedy="leave it out")
        return load_rig(options.rig)
    if isinstance(options.plant, Twin):
        if options.limits:
            raise DataError("a twin has its own", parameter="limits", remedy="leave it out")
        return options.plant
    if wrong := [name for name, ends in options.limits.items() if len(ends) != 2 or None in ends]:
        remedy = f"write `limits[{wrong[0]}]=LOW:HIGH`; `slew` limits the rate"
        raise DataError("limits of a plant are two numbers", channel=wrong[0], remedy=remedy)
    name = next((path.stem for path in paths(options.plant)), "plant")
    limits: Any = dict(options.limits)
    return Twin(load_model(options.plant), limits=limits, name=name, rest_length=rest_length)


def export(
    model: Model,
    out: str | Path,
    target: Literal["c", "fmu", "ros2", "mjcf"] = "c",
    options: ExportOptions | MJCFOptions | None = None,
    **keywords: Unpack[AnyExportKeywords],
) -> Exported:
    """Write a model as code: C99, an FMU, a ROS 2 package, or MJCF for MuJoCo.

    Parameters
    ----------
    model : Block, or file
    out : path
        Folder, or for an FMU and MJCF the file, to write.
    target : {"c", "fmu", "ros2", "mjcf"}
        Of that target: `COptions`, `FMUOptions`, `MJCFOptions`, or for ROS 2 `ExportOptions`.
    """
    from mckibben.outputs import refuse_inputs
    from mckibben.studying.inverting import build_compensator

    kinds = {"c": COptions, "fmu": FMUOptions, "ros2": ExportOptions, "mjcf": MJCFOptions}
    if target not in kinds:
        problem = f"there is no target {target!r:.60}"
        raise ModelError(problem, parameter="target", remedy="use c, fmu, ros2 or mjcf")
    settings: Any = given_options(kinds[target], options, keywords, ["target"])
    out = Path(out)
    _require_fitting_path(out, target)
    refuse_inputs(out, paths(model))
    if target == "mjcf":
        return _export_mjcf(load_model(model), out, settings)
    block = load_model(model, settings.fields)
    block = build_compensator(block, settings.sample_time) if settings.inverse else block
    return _export_program(block, out, target, next(iter(paths(model)), None), settings)


def _require_fitting_path(out: Path, target: str) -> None:
    """Raise an error for the path of a file where a folder is written."""
    target_of_ending = {".fmu": "fmu", ".xml": "mjcf", ".c": "c", ".h": "c"}
    fitting = target_of_ending.get(out.suffix.casefold())
    if target in ("c", "ros2") and fitting is not None:
        other = f", or give `target={fitting}`" if fitting != target else ""
        raise DataError("a folder is written", file=out, remedy=f"name a folder{other}")


def _export_program(
    block: Block, out: Path, target: str, file: Path | None, options: Any
) -> Exported:
    """Write a block as C99, an FMU or a ROS 2 package, named by default after its file."""
    from mckibben.exporting import export_c, export_fmu, export_ros2
    from mckibben.exporting.c.emulation import emulate
    from mckibben.exporting.naming import name_from
    from mckibben.exporting.programs import self_test

    name = options.name or ("model" if file is None else name_from(file))
    common = {"sample_time": options.sample_time, "force": options.force}
    tests: list[str | None] = [None, None]
    if target == "c":
        serving = _serving(options)
        export_c(block, out, name=name, single=options.single, serving=serving, **common)
        tests = [
            self_test(out, name) if options.check else None,
            str(emulate(block, sample_time=options.sample_time)) if options.emulate else None,
        ]
    elif target == "fmu":
        export_fmu(block, out, name=name, library=options.library, **common)
    else:
        name = options.name or name.lower()
        export_ros2(block, out, name=name, **common)
    return Exported(out, name, tuple(_contents(out)), *tests)


def _export_mjcf(model: Block, out: Path, options: MJCFOptions) -> Exported:
    """Write a muscle as MJCF, hung from the world or between two sites."""
    from mckibben.exporting.mjcf import Sites, export_mjcf
    from mckibben.exporting.naming import name_from

    ends = options.site_from, options.site_to
    if options.rest_length is None:
        raise ModelError("it is needed", parameter="rest_length", remedy="give it, in mm")
    if None not in ends and options.example != "hanging":
        problem = "a muscle between sites of your own model has no example"
        raise ModelError(problem, parameter="example", remedy="leave it out, or the sites")
    if sum(end is None for end in ends) == 1:
        remedy = "give both, or neither"
        raise ModelError("one site is missing", parameter="site_from", remedy=remedy)
    name = options.name or name_from(out)
    export_mjcf(
        model,
        out,
        rest_length=options.rest_length,
        name=name,
        sites=None if None in ends else Sites(*map(str, ends)),
        example=options.example,
        lag=options.lag,
        force=options.force,
    )
    return Exported(out, name, (out.name,))


def _contents(path: Path) -> list[str]:
    """Return the files in a folder or a zip."""
    if path.is_dir():
        return sorted(p.relative_to(path).as_posix() for p in path.rglob("*") if p.is_file())
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def _serving(options: COptions) -> Any:
    """Return the settings of the serial server of exported code, if it has one."""
    from mckibben.exporting.c.serving import Serving

    if not options.link:
        for name in ("limits", "safe", "watchdog"):
            if getattr(options, name):
                raise ModelError(
                    "it applies to code with a serial link", parameter=name, remedy="add `link`"
                )
        return None
    watchdog = 0.5 if options.watchdog is None else options.watchdog
    return Serving(options.limits, options.safe, watchdog)

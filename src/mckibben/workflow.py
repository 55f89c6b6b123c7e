"""Operations of users: fit, study, track, learn, invert, check, plan, review, export.

The command line, the workbench and Python call these. Each takes recordings, or files with some, and
returns a result that has numbers as ``to_dict()``. Parameters that they have in common:

options : dataclass, optional
    Of `mckibben.options`; its fields may also be given by name.
reading : ReadOptions, optional
    How files are read; its fields may also be given by name.
out : path, optional
    File or folder to write. The files of an earlier run are replaced when all is done.
force : bool
    Whether files of the user's may be replaced, too; what is read never is.
progress : bool or callable, optional
    Whether to show a bar; or called with the share done and words.

They raise `DataError` on recordings, and `ModelError` on models or options, that cannot be used.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_type_hints

from mckibben import registry
from mckibben.channels import channels_of
from mckibben.errors import DataError, ModelError
from mckibben.options import (
    CompareOptions,
    COptions,
    ExportOptions,
    FitOptions,
    FMUOptions,
    InvertOptions,
    LearnOptions,
    MJCFOptions,
    Options,
    PlanOptions,
    ReadOptions,
    StudyOptions,
    TrackOptions,
    given_options,
)
from mckibben.reading import Data, files_of, items, loaded, read_files, read_sides
from mckibben.recording import COMMAND, Recording, sample_time_of
from mckibben.studying.results import Exported, Fit, Inverse, Price, Tracking
from mckibben.system.progress import Tell, telling

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from mckibben.blocks.base import Block
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.control import Learned
    from mckibben.diagnosis.check import Validation
    from mckibben.diagnosis.review import Review
    from mckibben.outputs import Results
    from mckibben.planning.planner import Plan
    from mckibben.studying.study import Study

Progress = bool | Tell | None


def fit(
    model: str,
    data: Data,
    options: FitOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **given: Any,
) -> Fit:
    """Identify one model, by its short name, such as ``"gpi"``."""
    from mckibben.blocks.compose import Parallel
    from mckibben.comparison.planning import Candidate, refusals
    from mckibben.estimators.catalogue import settings_of
    from mckibben.signals.shared_rows import check_shared

    chosen, reading = _chosen(FitOptions, options, reading, given)
    settings = settings_of(model, chosen.settings)
    prior = chosen.prior or settings.get("prior")
    file = _claim(out, _paths(data, chosen.residual_of, prior), force)
    kind = registry.load("estimators", model)
    if chosen.target is not None and chosen.target not in kind.targets:
        problem = f"{model!r} cannot be fitted for {chosen.target}"
        raise ModelError(problem, parameter="target", remedy="fit 'balance', or leave it out")
    if chosen.prior is not None:
        if "prior" not in kind.__dataclass_fields__:
            raise ModelError(f"{model!r} has none", parameter="prior", remedy="leave it out")
        settings["prior"] = chosen.prior
    settings = {"seed": chosen.seed} | settings
    sides = [settings.pop(side, getattr(chosen, side)) for side in ("input", "output")]
    names = [*sides, settings.get("scheduling")]
    (runs,), channels = read_sides([data], lambda some: kind.resolved(some, *names), sides, reading)
    if refused := refusals({model: Candidate(model)}, runs, channels):
        problem = f"{model!r} does not apply to {', '.join(channels.sides)}: {refused[model]}"
        remedy = "name channels with `input=NAME` and `output=NAME`, or fit another model"
        raise DataError(problem, remedy=remedy)
    settings = kind.channel_settings(channels) | settings
    estimator = kind(**{**kind.targets.get(chosen.target, {}), **settings})
    base = saved(chosen.residual_of)
    if base is not None:
        runs = _residuals(base, estimator, runs)
    used = estimator.data(runs)
    check_shared({"fit": runs}, *([one.name for one in of] for of in (used.inputs, used.outputs)))
    taken = [one.name for one in (*used.inputs, *used.outputs, *used.scheduled)]
    if chosen.target is not None and not any(name.startswith("force") for name in taken):
        problem = f"a model for {chosen.target} is fitted to a measured force"
        raise DataError(problem, channel="force", remedy="give recordings with one")
    with telling(progress, f"fitting {model}") as tell:
        estimator.fit(runs, progress=tell)
    price = None
    if chosen.target is not None:
        from mckibben.export.mjcf import carried

        carried(estimator.model_)
        free = kind(**{"of_force": True} | settings)
        with telling(progress, f"fitting {model} without the limits of {chosen.target}") as tell:
            free.fit(runs, progress=tell)
        price = Price(*(_force_error(one.model_, runs) for one in (estimator, free)))
    found: Block = estimator.model_ if base is None else Parallel((base, estimator.model_))
    if file is not None:
        found.save(file)
    notes = list(estimator.diagnostics_.notes)
    if unused := [name for name in (*channels.further, *channels.unused) if name not in taken]:
        notes.append(f"not used: {', '.join(unused)}; name what drives with `input`")
    return Fit(model, found, estimator, tuple(notes), file, price)


def _force_error(model: Block, runs: Sequence[Recording]) -> float:
    """Return the RMSE of the force by displacement and pressure, from rest [N]."""
    from mckibben.blocks.coupled.load_estimate import load_of

    block = load_of(model)
    names, (force,) = [one.name for one in block.inputs], [one.name for one in block.outputs]
    errors = [
        block.simulate(run.matrix(names), sample_time=run.sample_time)[:, 0] - run[force]
        for run in runs
    ]
    return math.sqrt(sum(float(e @ e) for e in errors) / sum(e.size for e in errors))


def _residuals(base: Block, estimator: Any, runs: list[Recording]) -> list[Recording]:
    """Return recordings with a model's output subtracted."""
    from mckibben.estimators.force.multistate import extract_hysteresis

    names = [channel.name for channel in base.outputs]
    if names != [estimator.output]:
        raise ModelError(
            f"the model gives {', '.join(names)}, but {estimator.output} is fitted",
            parameter="residual_of",
            remedy="name a model of the same output, or `output=NAME`",
        )
    return extract_hysteresis(runs, base, output=estimator.output)


def compare(
    train: Data,
    test: Data = (),
    options: CompareOptions | None = None,
    *,
    validation: Data = (),
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    executor: Executor | None = None,
    progress: Progress = None,
    **given: Any,
) -> Leaderboard:
    """Fit models, choose by cross-validation, and test on data used for neither; all free-running.

    Recordings in a folder with a ``protocol.json`` have the roles stated there; ``validation``
    replaces cross-validation in the choice. An interrupted comparison returns the finished models;
    with ``out``, the same call resumes it. An ``executor`` fits the models instead of own processes.
    """
    from mckibben.comparison.ranking import compare as rank
    from mckibben.report.results_folder import LEADERBOARD, write_leaderboard

    chosen, reading = _chosen(CompareOptions, options, reading, given)
    sides = train, validation, test
    with _compared(sides, chosen, reading, out, force, lambda _: LEADERBOARD) as (data, results):
        board = rank(
            **data, options=chosen, clear=False, executor=executor, progress=_standing(progress)
        )
        if results is not None:
            write_leaderboard(board, results)
            if not board.stopped:
                _complete(results)
    return board


def study(
    train: Data,
    test: Data = (),
    options: StudyOptions | None = None,
    *,
    validation: Data = (),
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    command: str = "",
    executor: Executor | None = None,
    progress: Progress = None,
    found: Callable[[Study], None] | None = None,
    **given: Any,
) -> Study:
    """Characterize a muscle, choose a model as `compare` does, check and invert it, and write a report.

    ``command`` is how the study is repeated, for the report. ``found`` is called with the study so far:
    once the muscle is characterized, then after every model. ``executor`` as of `compare`.
    """
    from mckibben.report.results_folder import StudyFolder, study_files
    from mckibben.studying.study import study as run

    chosen, reading = _chosen(StudyOptions, options, reading, given)
    ran = {"model": saved(chosen.model), "compensator": saved(chosen.compensator)}
    sides = train, validation, test
    with _compared(sides, chosen, reading, out, force, study_files) as (data, results):
        folder = None if results is None else StudyFolder(results, command, title=chosen.title)

        def pass_on(so_far: Study) -> None:
            if folder is not None:
                folder.take(so_far)
            if found is not None:
                found(so_far)

        done = run(
            **data,
            options=replace(chosen, **ran),
            executor=executor,
            progress=_standing(progress),
            found=pass_on,
        )
        if folder is not None:
            folder.take(done, last=True)
        if results is not None and not done.leaderboard.stopped:
            _complete(results)
    return done


def _complete(results: Results) -> None:
    """Move the files of a comparison to their places, and remove its checkpoints."""
    from mckibben.checkpoints import Checkpoints

    results.commit()
    Checkpoints(results.folder).clear()


def _standing(progress: Progress) -> Any:
    """Return a progress callback for the progress of a comparison."""
    if not callable(progress):
        return progress
    return lambda standing: progress(standing.share, str(standing))


@contextmanager
def _compared(
    data: Sequence[Data],
    chosen: CompareOptions,
    reading: ReadOptions | None,
    out: str | Path | None,
    force: bool,
    written: Callable[[Sequence[str]], Sequence[str]],
) -> Iterator[tuple[dict[str, Any], Results | None]]:
    """Claim the output files of a comparison, and return its data: to fit, to choose and to test."""
    from mckibben.files.sources import expanded
    from mckibben.outputs import results_in
    from mckibben.system import workers

    if chosen.jobs != 1:
        workers.prepare()
    whole = chosen.models in ("all", "quick")
    names = registry.names("estimators") if whole else list(map(str, chosen.models))
    train, validation, test = data
    files = expanded(files_of(train), files_of(test))
    runs: Sequence[Sequence[Recording | Path]] = loaded(train), items(validation), loaded(test)
    sides: list[Data] = [[*some, *more] for some, more in zip(files, runs, strict=True)]
    logs = [getattr(chosen, name, None) for name in ("model", "compensator")]
    read = _paths(train, *sides, logs)
    kind = "study" if isinstance(chosen, StudyOptions) else "compare"
    with results_in(out, written(names), inputs=read, force=force, kind=kind) as results:
        words = chosen.inputs, chosen.outputs, chosen.load
        found, channels = read_sides(sides, lambda some: channels_of(some, *words), words, reading)
        roles = dict(zip(("train", "validation", "test"), found, strict=True))
        yield {**roles, "channels": channels, "folder": out}, results


def track(
    compensator: Block | str | Path,
    reference: Recording | str | Path,
    options: TrackOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    controller_out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **given: Any,
) -> Tracking:
    """Track a reference with a compensator or a controller on a virtual rig or on a model.

    ``out`` is the recording of the run, ``controller_out`` the controller, for `export`.
    """
    from mckibben.blocks.base import Block
    from mckibben.blocks.feedback import FeedforwardFeedback
    from mckibben.blocks.fields import drives
    from mckibben.control import (
        BlockController,
        before,
        control_law,
        learn,
        preview_time,
        tune_pid,
    )
    from mckibben.control import track as close
    from mckibben.control.connecting import asked, flatters_feedback, kind_of, offered
    from mckibben.control.controller import samples_ahead
    from mckibben.files import write
    from mckibben.studying.recorded_inputs import beyond_known

    chosen, reading = _chosen(TrackOptions, options, reading, given)
    read = _paths(compensator, reference, chosen.rig, chosen.plant)
    file = _claim(out, read, force, recording=True)
    controller_file = _claim(controller_out, [*read, *_paths(out)], force)
    block, plant = saved(compensator, chosen.fields), _plant(chosen, reading)
    if not any(drives(channel) or channel.name.startswith(COMMAND) for channel in block.outputs):
        gives = ", ".join(channel.name for channel in block.outputs)
        raise ModelError(
            f"its outputs are {gives}, but a compensator's are pressures or commands",
            parameter="compensator",
            remedy="give the result of `invert()`",
        )
    (run, *_) = read_files(reference, None, reading)
    wanted = asked(plant, run, block)
    BlockController(block).connect(offered(plant, wanted))  # before anything is tuned
    step = sample_time_of(wanted, "be a reference")
    held = {name: float(wanted[name][0]) for name in plant.inputs if name in wanted}
    # commands are no pressures to be compared with what is measured
    commanded = any(channel.name.startswith(COMMAND) for channel in block.outputs)
    copied = ("approach", "settle", "noise", "delay", "slew", "seed")
    arguments: dict[str, Any] = {name: getattr(chosen, name) for name in copied}
    arguments["pressure_loop"] = chosen.pressure_loop and not commanded
    ahead = preview_time(block) if chosen.preview is None else chosen.preview
    with telling(progress, f"{chosen.controller} on {plant.name}") as tell:
        taught = None
        tuned = cache(
            lambda: tune_pid(plant, sample_time=step, scheduled=held, references=block.inputs)
        )
        if chosen.repetitions:
            numbers = count(chosen.seed)  # noise differs between repetitions

            def repeat(corrected: Block) -> Recording:
                law = control_law(chosen.controller, corrected, tuned)
                again = arguments | {"seed": next(numbers)}
                return close(law, plant, wanted, preview=chosen.preview, **again).recording

            taught = learn(
                block,
                repeat,
                chosen.repetitions,
                ahead=max(samples_ahead(ahead, step), 1) + block.samples_ahead,
                settle=round(chosen.approach / step) + round(chosen.settle / step),
            )
        law = control_law(chosen.controller, taught.best if taught else block, tuned)
        if controller_file is not None:
            further = ahead + block.samples_ahead * step > step
            if not isinstance(law, Block) or (isinstance(law, FeedforwardFeedback) and further):
                raise ModelError(
                    f"{chosen.controller!r} cannot be saved as one block",
                    parameter="controller_out",
                    remedy="leave it out; or use feedforward or pid, or both with `preview=0`",
                )
        halves = [_half(tell, start) for start in (0.0, 0.5)]
        tracked = close(law, plant, wanted, preview=chosen.preview, progress=halves[0], **arguments)
        without = before(block, plant, wanted, progress=halves[1], **arguments)
    if file is not None:
        write(without.beside(tracked.recording), file)
    if controller_file is not None and isinstance(law, Block):
        law.save(controller_file)
    return Tracking(
        tracked=tracked,
        uncompensated=without,
        plant=plant,
        plant_kind=kind_of(plant, block),
        flatters_feedback=flatters_feedback(plant, chosen.controller),
        law=chosen.controller,
        seed=chosen.seed,
        controller=law,
        reference=wanted,
        notes=(*beyond_known(block, wanted), *without.notes),
        file=file,
        controller_file=controller_file,
        learned=taught,
    )


def learn(
    compensator: Block | str | Path,
    runs: Data,
    options: LearnOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    **given: Any,
) -> Learned:
    """Learn from recorded repetitions of one motion; see `mckibben.control.learned`.

    ``runs`` are all of them, in order, and ``compensator`` that of the first. ``out`` is the compensator
    to run next.
    """
    from mckibben.control import learned

    chosen, reading = _chosen(LearnOptions, options, reading, given)
    file = _claim(out, _paths(compensator, *files_of(runs)), force)
    recordings = read_files(runs, None, reading)
    found = learned(saved(compensator), recordings, ahead=chosen.ahead, repeats=chosen.repeats)
    if file is not None:
        (found.best if chosen.best else found.next).save(file)
    return found


def _half(tell: Tell | None, start: float) -> Callable[[float], None] | None:
    return None if tell is None else lambda share: tell(start + 0.5 * share, "")


def _plant(chosen: TrackOptions, reading: ReadOptions | None) -> Any:
    """Return the plant of a loop: a rig, or a model as a twin of the user's muscle."""
    from mckibben.control import Twin
    from mckibben.rigs import Rig, load_rig

    rest_length = None if reading is None else reading.rest_length
    if (chosen.rig is None) == (chosen.plant is None):
        raise DataError(
            "a loop is closed on one plant",
            remedy="give `plant=model.json`, a model of your own muscle, or `rig=NAME`",
        )
    if chosen.rig is not None:
        for name, value in (("limits", chosen.limits), ("rest_length", rest_length)):
            if value:
                raise DataError("a rig has its own", parameter=name, remedy="leave it out")
        return chosen.rig if isinstance(chosen.rig, Rig) else load_rig(str(chosen.rig))
    if isinstance(chosen.plant, Twin):
        return chosen.plant
    if wrong := [name for name, ends in chosen.limits.items() if len(ends) != 2 or None in ends]:
        remedy = f"write `limits[{wrong[0]}]=LOW:HIGH`; `slew` limits the rate"
        raise DataError("limits of a plant are two numbers", channel=wrong[0], remedy=remedy)
    name = next((path.stem for path in _paths(chosen.plant)), "plant")
    limits: Any = dict(chosen.limits)
    return Twin(saved(chosen.plant), limits=limits, name=name, rest_length=rest_length)


def invert(
    model: Block | str | Path,
    options: InvertOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **given: Any,
) -> Inverse:
    """Return the compensator of a model, from desired output to input; or its force estimator."""
    chosen, reading = _chosen(InvertOptions, options, reading, given)
    chosen.check()
    file = _claim(out, _paths(model, chosen.learned), force)
    found = _inverse(saved(model, chosen.fields), chosen, reading, progress)
    if file is not None:
        found.block.save(file)
    return replace(found, file=file)


def _inverse(
    block: Block, chosen: InvertOptions, reading: ReadOptions | None, progress: Progress
) -> Inverse:
    from mckibben.blocks.adaptive import adaptive
    from mckibben.blocks.coupled.load_estimate import ForceCompensator, load_of
    from mckibben.blocks.fields import drives
    from mckibben.blocks.force.feedforward import ForceFeedforward
    from mckibben.blocks.predictive import Predictive
    from mckibben.estimators.coupled.sdchm import trained_inverse
    from mckibben.studying.inverting import made

    if chosen.learned:
        runs = read_files(chosen.learned, None, reading)
        with telling(progress, "learning the inverse") as tell:
            learned, rmse = trained_inverse(block, runs, chosen.seed, tell)
        return Inverse(learned, "learned", rmse=rmse)
    if chosen.predictive:
        return Inverse(Predictive(made(block), **chosen.of_predictive()), "predictive")
    if chosen.wanted == "force":
        if all(channel.name.startswith("force") for channel in block.outputs):
            return Inverse(block, "itself")
        return Inverse(load_of(block), "force")
    if not chosen.adaptive:
        if ForceFeedforward.of(block) or ForceCompensator.of(block):
            return Inverse(made(block), "feedforward")
        if not block.inverts and drives(block.outputs[0]) and not drives(block.inputs[0]):
            return Inverse(block, "itself")
    kind = "adaptive" if chosen.adaptive else "inverse"
    time = 60.0 if chosen.time is None else chosen.time
    tested = made(block)
    inverse = adaptive(block, time, chosen.noise) if chosen.adaptive else tested
    ends = [(float(low), float(high)) for low, high in zip(*block.reachable(), strict=True)]
    known = all(math.isfinite(end) for pair in ends for end in pair)
    names = [channel.name for channel in block.outputs]
    return Inverse(inverse, kind, dict(zip(names, ends, strict=True)) if known else {})


def check(
    model: Block | str | Path,
    data: Data,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **given: Any,
) -> Validation:
    """Check a model on recordings, and its residuals' causes; see `mckibben.diagnosis.check`.

    With ``out``, a folder, ``validation.json`` and ``report.html`` are written.
    """
    from mckibben.diagnosis.check import check as find
    from mckibben.diagnosis.description import describe
    from mckibben.files.sources import expanded
    from mckibben.outputs import results_in
    from mckibben.report.check_page import write_check

    reading = given_options(ReadOptions, reading, given)
    files: Data = [*loaded(data), *expanded([], files_of(data))[2]]
    names = ["validation.json", "report.html"]
    with results_in(out, names, inputs=_paths(model, files), force=force, kind="check") as results:
        block = saved(model)
        needed = dict.fromkeys(channel.name for channel in (*block.inputs, *block.outputs))
        recordings = read_files(files, list(needed), reading)
        found = find(block, recordings, progress=progress)
        found = replace(found, description=describe(block, recordings, fitted=False))
        if results is not None:
            write_check(results, found, next(map(str, _paths(model)), block.title))
            results.commit()
    return found


def plan(
    data: Data = (),
    options: PlanOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    **given: Any,
) -> Plan:
    """Return a plan of the next recording: random motion within limits, and runs that close data gaps.

    With ``out``, its commands are written as a recording.
    """
    from mckibben.files import write
    from mckibben.planning.planner import plan as make

    chosen, reading = _chosen(PlanOptions, options, reading, given)
    arguments = {one.name: getattr(chosen, one.name) for one in fields(chosen)}
    file = _claim(out, _paths(data, chosen.rig), force, recording=True)
    found = make(read_files(data, None, reading), **arguments)
    if file is not None:
        write(found.recording, file)
    return found


def review(
    log: Data,
    *,
    model: Block | str | Path | None = None,
    compensator: Block | str | Path | None = None,
    refit: bool = True,
    seed: int = 0,
    reading: ReadOptions | None = None,
    **given: Any,
) -> Review:
    """Return the review of a loop's log: tracking error and its causes; see `diagnosis.review`.

    The log has a reference, such as ``reference_displacement``; one of model and compensator is enough.
    """
    from mckibben.diagnosis.review import review as find

    reading = given_options(ReadOptions, reading, given)
    ran = {"model": saved(model), "compensator": saved(compensator)}
    return find(read_files(log, None, reading), refit=refit, seed=seed, **ran)


def export(
    model: Block | str | Path,
    out: str | Path,
    target: Literal["c", "fmu", "ros2", "mjcf"] = "c",
    options: ExportOptions | MJCFOptions | None = None,
    **given: Any,
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
    from mckibben.export import export_c, export_fmu, export_ros2
    from mckibben.export.c.emulation import emulate
    from mckibben.export.naming import name_from
    from mckibben.export.programs import self_test
    from mckibben.outputs import refuse_inputs
    from mckibben.studying.inverting import made

    kinds = {"c": COptions, "fmu": FMUOptions, "ros2": ExportOptions, "mjcf": MJCFOptions}
    if target not in kinds:
        problem = f"there is no target {target!r:.60}"
        raise ModelError(problem, parameter="target", remedy="use c, fmu, ros2 or mjcf")
    chosen: Any = given_options(kinds[target], options, given)
    out = Path(out)
    refuse_inputs(out, _paths(model))
    if target == "mjcf":
        return _export_mjcf(saved(model), out, chosen)
    block = saved(model, chosen.fields)
    block = made(block, chosen.sample_time) if chosen.inverse else block
    name = chosen.name or next(map(name_from, _paths(model)), "model")
    common = {"sample_time": chosen.sample_time, "force": chosen.force}
    tests: list[str | None] = [None, None]
    if target == "c":
        serving = _serving(chosen)
        export_c(block, out, name=name, single=chosen.single, serving=serving, **common)
        tests = [
            self_test(out, name) if chosen.check else None,
            str(emulate(block, sample_time=chosen.sample_time)) if chosen.emulate else None,
        ]
    elif target == "fmu":
        export_fmu(block, out, name=name, library=chosen.library, **common)
    else:
        name = chosen.name or name.lower()
        export_ros2(block, out, name=name, **common)
    return Exported(out, name, tuple(_contents(out)), *tests)


def _export_mjcf(model: Any, out: Path, chosen: MJCFOptions) -> Exported:
    """Write a muscle as MJCF."""
    from mckibben.export.mjcf import Sites, export_mjcf
    from mckibben.export.naming import name_from

    ends = chosen.site_from, chosen.site_to
    if chosen.rest_length is None:
        raise ModelError("it is needed", parameter="rest_length", remedy="give it, in mm")
    if None not in ends and chosen.example != "hanging":
        problem = "a muscle between sites of your own model has no example"
        raise ModelError(problem, parameter="example", remedy="leave it out, or the sites")
    if sum(end is None for end in ends) == 1:
        remedy = "give both, or neither"
        raise ModelError("one site is missing", parameter="site_from", remedy=remedy)
    name = chosen.name or name_from(out)
    export_mjcf(
        model,
        out,
        rest_length=chosen.rest_length,
        name=name,
        sites=None if None in ends else Sites(*map(str, ends)),
        example=chosen.example,
        lag=chosen.lag,
        force=chosen.force,
    )
    return Exported(out, name, (out.name,))


def _contents(path: Path) -> list[str]:
    """Return the files in a folder or a zip."""
    if path.is_dir():
        return sorted(p.relative_to(path).as_posix() for p in path.rglob("*") if p.is_file())
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def _serving(chosen: COptions) -> Any:
    """Return the settings of the serial server of exported code, if it has one."""
    from mckibben.export.c.serving import Serving

    if not chosen.link:
        for name in ("limits", "safe", "watchdog"):
            if getattr(chosen, name):
                raise ModelError(
                    "it applies to code with a serial link", parameter=name, remedy="add `link`"
                )
        return None
    watchdog = 0.5 if chosen.watchdog is None else chosen.watchdog
    return Serving(chosen.limits, chosen.safe, watchdog)


def _chosen(
    kind: type[Options],
    options: Options | None,
    reading: ReadOptions | None,
    given: Mapping[str, Any],
) -> tuple[Options, ReadOptions | None]:
    """Return options of an operation and of reading, either with fields given by name."""
    names = {one.name for one in fields(ReadOptions)} - {*get_type_hints(kind)}
    read = {name: value for name, value in given.items() if name in names}
    rest = {name: value for name, value in given.items() if name not in read}
    chosen = given_options(kind, options, rest, sorted(names))
    return chosen, given_options(ReadOptions, reading, read) if read else reading


def saved(model: Any, settings: Mapping[str, Any] | None = None) -> Any:
    """Return a model, also from a file or a result of `fit` or `invert`, with some fields set."""
    from mckibben.blocks.saving import load
    from mckibben.blocks.setting import with_fields

    if model is None:
        return None
    if isinstance(model, Fit | Inverse):
        model = model.model if isinstance(model, Fit) else model.block
    return with_fields(load(model) if isinstance(model, str | Path) else model, settings or {})


def _paths(*given: Any) -> list[Path]:
    """Return the files among arguments, also in lists."""
    found: list[Path] = []
    for one in given:
        if isinstance(one, str | Path):
            found.append(Path(one))
        elif isinstance(one, list | tuple):
            found += _paths(*one)
    return found


def _claim(
    out: str | Path | None, read: Sequence[Path], force: bool, *, recording: bool = False
) -> Path | None:
    """Raise an error for a path that is an input or a user's file, before any work; return the path."""
    from mckibben.outputs import claim, claim_recording

    if out is None:
        return None
    (claim_recording if recording else claim)(out, inputs=read, force=force)
    return Path(out)

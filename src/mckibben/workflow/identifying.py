"""Identification: `fit` of one model, `compare` of several, and `study` from recording to report."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from mckibben import registry
from mckibben.channels import channels_of
from mckibben.errors import DataError, ModelError
from mckibben.files.memory import Data, items
from mckibben.keywords import CompareKeywords, FitKeywords, StudyKeywords
from mckibben.options import (
    FILES,
    TEST,
    Argument,
    CompareOptions,
    FitOptions,
    Option,
    ReadOptions,
    StudyOptions,
)
from mckibben.reading import files_of, loaded, read_sides
from mckibben.recording import Recording
from mckibben.studying.results import Fit, Price
from mckibben.system.progress import Tell, telling
from mckibben.workflow.operation import (
    Progress,
    claim_output,
    load_model,
    operation,
    options_of,
    paths,
)

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from mckibben.blocks.base import Block
    from mckibben.channels import Channels
    from mckibben.comparison.leaderboard import Leaderboard
    from mckibben.estimators.core.estimator import Estimator
    from mckibben.outputs import Results
    from mckibben.studying.study import Study


@operation(
    {"model": Argument("MODEL", "Short name; see info --models.", kind=str), "data": FILES},
    FitOptions,
    out=Option("Model file to write (JSON).", "FILE", "-o"),
    must_write=True,
)
def fit(
    model: str,
    data: Data,
    options: FitOptions | None = None,
    *,
    reading: ReadOptions | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Progress = None,
    **keywords: Unpack[FitKeywords],
) -> Fit:
    """Identify one model from recordings.

    Models of several muscles (balance, coupled-memory, coupled-pi, sdchm, tsfnn) use the channels
    pressure_1 ..., displacement_1 ..., and pressure_extensor if present.

    Parameters
    ----------
    model : str
        Short name, such as ``"gpi"``; see `models`.
    data, options, reading, out, force, progress
        See `mckibben.workflow`; options are those of `mckibben.options.FitOptions`.
    """
    from mckibben.blocks.compose import Parallel
    from mckibben.estimators.catalogue import settings_of

    if not isinstance(model, str):
        problem = f"a model is named, and this is {type(model).__name__}"
        raise ModelError(problem, parameter="model", remedy="give its short name, then the data")
    options, reading = options_of(FitOptions, options, reading, keywords)
    settings = settings_of(model, options.settings)
    prior = options.prior or settings.get("prior")
    file = claim_output(out, paths(data, options.residual_of, prior), force)
    kind = registry.load("estimators", model)
    settings = _with_options(model, kind, settings, options)

    sides = [settings.pop(side, getattr(options, side)) for side in ("input", "output")]
    runs, channels = _fit_data(model, kind, data, [*sides, settings.get("scheduling")], reading)
    settings = kind.channel_settings(channels) | settings
    estimator = kind(**{**kind.targets.get(options.target, {}), **settings})
    base = load_model(options.residual_of)
    if base is not None:
        runs = _residuals(base, estimator, runs)
    names = _fitted_channels(estimator, runs, options.target)

    with telling(progress, f"fitting {model}") as tell:
        estimator.fit(runs, progress=tell)
    price = None
    if options.target is not None:
        unlimited = kind(**{"of_force": True} | settings)
        label = f"fitting {model} without the limits of {options.target}"
        with telling(progress, label) as tell:
            price = _price_of_limits(estimator, unlimited, runs, tell)
    block: Block = estimator.model_ if base is None else Parallel((base, estimator.model_))
    if file is not None:
        block.save(file)
    notes = list(estimator.diagnostics_.notes)
    if unused := [name for name in (*channels.further, *channels.unused) if name not in names]:
        notes.append(f"not used: {', '.join(unused)}; name what drives with `input`")
    return Fit(model, block, estimator, tuple(notes), file, price)


def _fit_data(
    model: str, kind: Any, data: Data, names: Sequence[Any], reading: ReadOptions
) -> tuple[list[Recording], Channels]:
    """Return recordings, and the channels of a kind of estimator by the names of the user.

    The names are those of input, output and scheduling.

    Raises
    ------
    DataError
        If the model does not apply to these channels.
    """
    from mckibben.comparison.planning import Candidate, refusals

    (runs,), channels = read_sides(
        [data], lambda some: kind.resolved(some, *names), names[:2], reading
    )
    if refused := refusals({model: Candidate(model)}, runs, channels):
        problem = f"{model!r} does not apply to {', '.join(channels.sides)}: {refused[model]}"
        remedy = "name channels with `input=NAME` and `output=NAME`, or fit another model"
        raise DataError(problem, remedy=remedy)
    return runs, channels


def _fitted_channels(estimator: Estimator, runs: list[Recording], target: str | None) -> list[str]:
    """Return the names of the channels that an estimator fits to; raise an error if they do not do.

    Raises
    ------
    DataError
        If inputs or outputs are the same data in two recordings, or a target needs a force.
    """
    from mckibben.signals.shared_rows import check_shared

    data = estimator.data(runs)
    sides = [[channel.name for channel in side] for side in (data.inputs, data.outputs)]
    check_shared({"fit": runs}, *sides)
    names = [*sides[0], *sides[1], *(channel.name for channel in data.scheduled)]
    if target is not None and not any(name.startswith("force") for name in names):
        problem = f"a model for {target} is fitted to a measured force"
        raise DataError(problem, channel="force", remedy="give recordings with one")
    return names


def _price_of_limits(
    limited: Estimator, unlimited: Estimator, runs: list[Recording], tell: Tell | None
) -> Price:
    """Return the errors of the force with the limits of an export format, and of a fit without them."""
    from mckibben.exporting.mjcf import require_exportable

    require_exportable(limited.model_)
    unlimited.fit(runs, progress=tell)
    return Price(*(_force_error(estimator.model_, runs) for estimator in (limited, unlimited)))


def _with_options(
    model: str, kind: Any, settings: dict[str, Any], options: FitOptions
) -> dict[str, Any]:
    """Return the settings of an estimator with the options that are settings: seed and prior.

    Raises
    ------
    ModelError
        If the estimator has no such target, or takes no prior.
    """
    if options.target is not None and options.target not in kind.targets:
        problem = f"{model!r} cannot be fitted for {options.target}"
        raise ModelError(problem, parameter="target", remedy="fit 'balance', or leave it out")
    if options.prior is not None:
        if "prior" not in kind.__dataclass_fields__:
            raise ModelError(f"{model!r} has none", parameter="prior", remedy="leave it out")
        settings = settings | {"prior": options.prior}
    return {"seed": options.seed} | settings


def _force_error(model: Block, runs: Sequence[Recording]) -> float:
    """Return the RMSE of the force by displacement and pressure, from rest [N]."""
    from mckibben.blocks.coupled.load_estimate import load_of

    block = load_of(model)
    names, (force,) = [one.name for one in block.inputs], [one.name for one in block.outputs]
    errors = [
        block.simulate(run.matrix(names), sample_time=run.sample_time)[:, 0] - run[force]
        for run in runs
    ]
    return math.sqrt(
        sum(float(error @ error) for error in errors) / sum(error.size for error in errors)
    )


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


@operation(
    {"train": FILES, "test": TEST},
    CompareOptions,
    out=Option("Folder for leaderboard.json and .csv.", "DIR", "-o"),
    writes=("leaderboard.json", "leaderboard.csv"),
)
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
    **keywords: Unpack[CompareKeywords],
) -> Leaderboard:
    """Fit models, choose one by cross-validation, and test it on separate data. Errors are free-run.

    A folder includes all recordings in it, with the roles that a protocol.json states. Recordings of
    several muscles (pressure_1 ..., displacement_1 ...) are fitted by models that couple them; with the
    load named, it is an input. What is interrupted is resumed by the same call, where results are
    written to a folder.

    Parameters
    ----------
    train, test : data
        To fit and to choose, and to test on. Without ``test``, a part is held out.
    options, reading, out, force, progress
        See `mckibben.workflow`; options are those of `mckibben.options.CompareOptions`.
    validation : data, optional
        Replaces cross-validation in the choice.
    executor : concurrent.futures.Executor, optional
        Fits the models instead of own processes.
    """
    from mckibben.comparison.ranking import compare as rank
    from mckibben.report.results_folder import LEADERBOARD, write_leaderboard

    options, reading = options_of(CompareOptions, options, reading, keywords)
    sides = train, validation, test
    data_and_results = _comparison_data(sides, options, reading, out, force, lambda _: LEADERBOARD)
    with data_and_results as (data, results):
        board = rank(
            **data,
            options=options,
            clear=False,
            executor=executor,
            progress=_comparison_progress(progress),
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
    **keywords: Unpack[StudyKeywords],
) -> Study:
    """Characterize a muscle, choose a model as `compare` does, check and invert it, and write a report.

    ``command`` is how the study is repeated, for the report. ``found`` is called with the study so far:
    once the muscle is characterized, then after every model. ``executor`` as of `compare`.
    """
    from mckibben.report.results_folder import StudyFolder, study_files
    from mckibben.studying.study import study as run

    options, reading = options_of(StudyOptions, options, reading, keywords)
    loaded_models = {
        "model": load_model(options.model),
        "compensator": load_model(options.compensator),
    }
    sides = train, validation, test
    with _comparison_data(sides, options, reading, out, force, study_files) as (data, results):
        folder = None if results is None else StudyFolder(results, command, title=options.title)

        def on_update(so_far: Study) -> None:
            if folder is not None:
                folder.take(so_far)
            if found is not None:
                found(so_far)

        done = run(
            **data,
            options=replace(options, **loaded_models),
            executor=executor,
            progress=_comparison_progress(progress),
            found=on_update,
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


def _comparison_progress(progress: Progress) -> Any:
    """Return a progress callback for the progress of a comparison."""
    if not callable(progress):
        return progress
    return lambda standing: progress(standing.share, str(standing))


@contextmanager
def _comparison_data(
    data: Sequence[Data],
    options: CompareOptions,
    reading: ReadOptions | None,
    out: str | Path | None,
    force: bool,
    result_files: Callable[[Sequence[str]], Sequence[str]],
) -> Iterator[tuple[dict[str, Any], Results | None]]:
    """Claim the output files of a comparison, and return its data: to fit, to choose and to test."""
    from mckibben.files.sources import expanded
    from mckibben.outputs import results_in
    from mckibben.system import workers

    if options.jobs != 1:
        workers.prepare()
    all_models = options.models in ("all", "quick")
    names = registry.names("estimators") if all_models else list(options.models or ())
    train, validation, test = data
    files = expanded(files_of(train), files_of(test))
    others: Any = (loaded(train), items(validation), loaded(test))
    sides: list[Data] = [[*some, *more] for some, more in zip(files, others, strict=True)]
    logs = [getattr(options, name, None) for name in ("model", "compensator")]
    read = paths(train, *sides, logs)
    kind = "study" if isinstance(options, StudyOptions) else "compare"
    with results_in(out, result_files(names), inputs=read, force=force, kind=kind) as results:
        words = options.input, options.output, options.load
        runs, channels = read_sides(sides, lambda some: channels_of(some, *words), words, reading)
        roles = dict(zip(("train", "validation", "test"), runs, strict=True))
        yield {**roles, "channels": channels, "folder": out}, results


def models() -> dict[str, str]:
    """Return the short names of all models, each with its full name and what it represents."""
    from mckibben.estimators.catalogue import summary

    return {name: summary(name) for name in registry.names("estimators")}


def estimator(model: str, **settings: Any) -> Estimator:
    """Return the estimator of a model by its short name, after scikit-learn's conventions.

    Parameters
    ----------
    model : str
        Such as ``"gpi"``; see `models`.
    **settings
        Of the estimator; its ``get_params()`` lists them.

    Raises
    ------
    ModelError
        On an unknown model or setting.

    Examples
    --------
    >>> estimator("pi", n_operators=5).get_params()["n_operators"]
    5
    """
    from mckibben.estimators.catalogue import settings_of

    found: Estimator = registry.load("estimators", model)(**settings_of(model, settings))
    return found

"""Studies: characterization, model choice, check on the test, inverse, and closed loops on a rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.runs import FreeRun
from mckibben.channels import Channels, moved_by
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.comparison.planning import Plan, plan_of
from mckibben.comparison.ranking import Standing, rankings_of
from mckibben.control import UNCOMPENSATED, Tracked, before, control_law, track, tune_pid
from mckibben.diagnosis import Characterization, characterize
from mckibben.diagnosis.check import Validation, check_runs, check_usable
from mckibben.diagnosis.data_gaps import Gap, data_gaps
from mckibben.diagnosis.description import ModelDescription, describe
from mckibben.diagnosis.review import Review, review
from mckibben.errors import DataError, MckibbenError
from mckibben.options import StudyOptions, given_options
from mckibben.recording import COMMAND, Recording, listed, sample_time_of
from mckibben.rigs import load_rig
from mckibben.rigs.rig import Rig, changes, recorded_on
from mckibben.simulation import Simulates
from mckibben.splits import Split
from mckibben.studying.inverting import Compensation, compensation
from mckibben.system.atomic import plain
from mckibben.system.showing import Result


@dataclass(frozen=True, repr=False)
class Study(Simulates, Result):
    """Results of ``mckibben study``.

    Parameters
    ----------
    train, test : tuple of Recording
        Data to fit, and data to test on.
    characterization : Characterization or None
        What the muscle does; None of several muscles.
    leaderboard : Leaderboard
        Models in the order of the choice.
    predictions : mapping of str to tuple of array
        Model name to its free-running output on every training recording, then every test recording.
    inverse : Compensation or None
        Of the first model in the order of the choice that has a good one; None where none has.
    passed_over : mapping of str to str
        Models before that one, and why they have no compensator.
    loops : mapping of str to Tracked
        Errors of following a measured motion on a virtual rig, by controller.
    plant : str or None
        The rig, and what is changed of the published one.
    not_looped : str
        Why no loop was closed on the rig that the recordings name; empty where it was.
    load : str or None
        The channel given to models as the load, where one was named.
    notes : tuple of str
        What was assumed or mended on the way.
    data_gaps : tuple of Gap
        What the recordings cannot identify, most important first.
    check : Validation, str or None
        What the chosen model misses on the test, or why it was not checked; None without a choice.
    description : ModelDescription or None
        What the chosen model is: equations, parameters and how sure they are.
    review : Review or None
        How the loop that was logged followed its reference, where model or compensator are given.
    """

    face: ClassVar[str] = "study"

    train: tuple[Recording, ...]
    test: tuple[Recording, ...]
    characterization: Characterization | None
    leaderboard: Leaderboard
    predictions: Mapping[str, tuple[Array, ...]] = field(repr=False)
    inverse: Compensation | None
    passed_over: Mapping[str, str] = field(default_factory=dict)
    loops: Mapping[str, Tracked] = field(default_factory=dict, repr=False)
    plant: str | None = None
    not_looped: str = ""
    load: str | None = None
    notes: tuple[str, ...] = ()
    data_gaps: tuple[Gap, ...] = ()
    check: Validation | str | None = None
    description: ModelDescription | None = field(default=None, repr=False)
    review: Review | None = None

    @property
    def input(self) -> str:
        """The input channel."""
        return self.leaderboard.input

    @property
    def output(self) -> str:
        """The output channel."""
        return self.leaderboard.output

    @property
    def model(self) -> Block:
        """The chosen model; see `Leaderboard.model`."""
        return self.leaderboard.model

    def to_frame(self) -> Any:
        """Return the leaderboard as a data frame."""
        return self.leaderboard.to_frame()

    def to_dict(self) -> dict[str, Any]:
        """Return the results without models and their outputs."""
        copied = (
            *("characterization", "data_gaps", "check", "description", "review", "leaderboard"),
            *("inverse", "passed_over"),
        )
        tracking = {name: dict(tracked.rmse) for name, tracked in self.loops.items()}
        return {name: plain(getattr(self, name)) for name in copied} | {"tracking": tracking}


def study(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    options: StudyOptions | None = None,
    *,
    validation: Recording | Sequence[Recording] = (),
    channels: Channels | None = None,
    executor: Executor | None = None,
    folder: str | Path | None = None,
    progress: bool | Callable[[Standing], None] | None = None,
    found: Callable[[Study], None] | None = None,
    **keywords: Any,
) -> Study:
    """Characterize recordings, choose a model by cross-validation, test it, and invert it if possible.

    The compensator is that of the first model in the order of the choice whose inverse is right, stays
    within the recorded inputs, and whose error on the test is clearly below that of a static map; see
    `mckibben.studying.inverting`. If no model is recommended, there is none.

    For several muscles, or under a load, a test motion is tracked on a virtual rig with every
    inverse, and with PID feedback. An interrupt ends the work at once; the study then has the
    finished results. The log of a loop, of which options have the model or the compensator, is reviewed.

    Parameters
    ----------
    train, test, validation, channels, executor, folder, progress
        As for `mckibben.comparison.ranking.compare`.
    options : StudyOptions, optional
        Model and compensator are blocks. Its fields may also be given by name.
    found : callable, optional
        Called with the study so far: once the muscle is characterized, before any model is fitted,
        then whenever a model is finished.

    Raises
    ------
    DataError
        On recordings that cannot be used.
    """
    options = given_options(StudyOptions, options, keywords)
    recordings, tests, seed = listed(train), listed(test), options.seed
    log_review = _review_of(recordings, options)
    if log_review is not None and options.input is None:
        recordings = [_with_commands_as_pressures(recording) for recording in recordings]
        channels = None
    plan = plan_of(recordings, tests, options, validation=validation, channels=channels)
    if options.rig is not None and plan.data.channels.single:
        raise DataError(
            "loops are closed on a rig with recordings of several muscles, or under a load",
            remedy="leave `rig` out, or use `track()`",
        )
    rig = None if options.rig is None else load_rig(options.rig)
    report = found if found is not None else _no_report

    so_far = replace(_characterized(plan, recordings, tests), load=options.load, review=log_review)
    report(so_far)
    try:
        with rankings_of(plan, "studying", options.jobs, executor, folder, progress) as rankings:
            for ranking in rankings:
                so_far = replace(so_far, leaderboard=ranking.board, predictions=ranking.outputs)
                if ranking.board.pending:
                    report(so_far)
    except KeyboardInterrupt:
        if not so_far.leaderboard.rows:
            raise
        return replace(so_far, leaderboard=replace(so_far.leaderboard, stopped=True))

    so_far = _checked(so_far, plan)
    inverse, passed_over = compensation(so_far.leaderboard, plan.data.split, seed)
    so_far = replace(so_far, inverse=inverse, passed_over=passed_over)
    if not plan.data.channels.single and inverse is not None:
        so_far = _looped_on_rig(so_far, inverse.model, rig, [*recordings, *tests], seed)
    report(so_far)
    return so_far


def _review_of(recordings: Sequence[Recording], options: StudyOptions) -> Review | None:
    """Return the review of recordings as logs of a loop; None without its model or compensator.

    It does not see the test data, as it refits.
    """
    if options.model is None and options.compensator is None:
        return None
    blocks: Any = {"model": options.model, "compensator": options.compensator}
    return review(recordings, seed=options.seed, **blocks)


def _no_report(so_far: Study) -> None:
    """Take a study so far where nobody asks for it."""
    del so_far


def _characterized(
    plan: Plan, recordings: Sequence[Recording], tests: Sequence[Recording]
) -> Study:
    """Return a study without models: what the muscle does, and what its data cannot identify."""
    channels, together = plan.data.channels, [*recordings, *tests]
    loop_inputs, characterization = channels.inputs, None
    if len(channels.inputs) == len(channels.outputs) == 1:
        loop_inputs = (moved_by(together, channels.inputs[0]),)
        others = {*channels.inputs, *channels.scheduling} - set(loop_inputs)
        with suppress(DataError):  # a load that follows the input is a data gap
            characterization = characterize(
                together, loop_inputs[0], channels.outputs[0], scheduling=sorted(others)
            )
    return Study(
        train=plan.data.split.train,
        test=plan.data.split.test,
        characterization=characterization,
        leaderboard=plan.empty,
        predictions={},
        inverse=None,
        notes=plan.empty.notes,
        data_gaps=data_gaps(recordings, loop_inputs, channels.outputs, tests=tests),
    )


def _checked(ranked_study: Study, plan: Plan) -> Study:
    """Return a study with the check and the description of the chosen model, if there is one."""
    best = ranked_study.leaderboard.best
    if best is None or best.block is None:
        return ranked_study
    split = plan.data.split
    on_test = ranked_study.predictions[best.model][len(split.train) :]
    return replace(
        ranked_study,
        check=check_on_test(best.block, split, on_test, plan.data.channels.outputs),
        description=describe(best.block, split.train, fitted=True),
    )


def _looped_on_rig(
    inverted: Study, chosen: str, rig: Rig | None, recordings: Sequence[Recording], seed: int
) -> Study:
    """Return a study with closed loops on a rig, else on the one of the recordings, or why not."""
    try:
        plant = rig or recorded_rig(recordings)
        if plant is None:
            return inverted
        loops = closed_loops(inverted.leaderboard, chosen, plant, inverted.test, seed)
        return replace(inverted, loops=loops, plant=rig_title(plant))
    except DataError as error:
        return replace(inverted, not_looped=str(error))


def _with_commands_as_pressures(log: Recording) -> Recording:
    """Return a log with its commands as pressures, if these were not measured."""
    names = [name.removeprefix(COMMAND) for name in log.channels if name.startswith(COMMAND)]
    unmeasured = [name for name in names if name not in log]
    units = {name: log.units[COMMAND + name] for name in unmeasured}
    return log.with_channels(units, **{name: log[COMMAND + name] for name in unmeasured})


def check_on_test(
    model: Block, split: Split, modelled: Sequence[Array], outputs: Sequence[str]
) -> Validation | str:
    """Return the check of a model on the test, or why it cannot be checked.

    ``modelled`` are free-running outputs on every test recording, shape (n, k), with their names.
    """
    names = [channel.name for channel in model.outputs]
    places = [list(outputs).index(name) for name in names]
    training_outputs = np.concatenate([recording.matrix(names) for recording in split.train])
    runs = []
    for recording, rows, table in zip(split.test, split.test_rows, modelled, strict=True):
        scored = np.flatnonzero(rows)
        if not scored.size:
            continue
        start, stop = int(scored[0]), int(scored[-1]) + 1
        run = model.as_run(recording.slice(start, stop))
        runs.append(FreeRun.of(run, table[start:stop, places]))
    try:
        check_usable(model, [run.source for run in runs])
        return check_runs(model, runs, means=training_outputs.mean(axis=0))
    except DataError as error:
        return str(error)


LONGEST_MOTION = 200.0
"""Longest motion that is tracked [s]."""

HALF_WINDOW = 0.5
"""Half width of the window that smooths a measured motion before it is tracked [s]."""


def recorded_rig(recordings: Sequence[Recording]) -> Rig | None:
    """Return the virtual rig of recordings, in its recorded configuration; None if they name none.

    Raises
    ------
    DataError
        If it cannot be rebuilt, or there are several.
    """
    rigs = [recorded_on(recording) for recording in recordings]
    # where commands rest is no matter of the rig: a loop begins at its reference
    setups = [None if rig is None else rig.changed({"start": {}}) for rig in rigs]
    if any(setup != setups[0] for setup in setups):
        raise DataError(
            "the recordings are not all of one virtual rig", remedy="name the rig to close it on"
        )
    return rigs[0]


def rig_title(rig: Rig) -> str:
    """Return the name of a rig, and its changes from the published one."""
    changed = ", ".join(changes(rig) or ())
    return f"{rig.name} (changed: {changed})" if changed else rig.name


def closed_loops(
    board: Leaderboard, chosen: str, rig: Rig, tests: Sequence[Recording], seed: int
) -> dict[str, Tracked]:
    """Return tracking results of a measured motion: uncompensated, with every inverse, PID, and both.

    PID is combined with the inverse of the chosen model, where every pressure has a motion of its own.
    Of the tests, the one that moves most in its stillest output is followed. Nothing is chosen by it. An
    inverse that fails is left out; its model is in the leaderboard. There are none where inverses give
    pressures, and the rig takes volts.

    Raises
    ------
    DataError
        If that has no time.
    """
    inverses = {row.model: row.inverse for row in board.rows if row.inverse is not None}
    if not {channel.name for channel in inverses[chosen].outputs} <= set(rig.inputs):
        return {}
    reference_names = {channel.name for inverse in inverses.values() for channel in inverse.inputs}
    held = [name for name in rig.inputs if name in reference_names]
    reference = _followed(tests, board.outputs, held)
    step = sample_time_of(reference, "be tracked")
    scheduled = {name: float(reference[name][0]) for name in held}
    references = inverses[chosen].inputs
    tuned = cache(
        partial(
            tune_pid, rig, sample_time=step, scheduled=scheduled, references=references, seed=seed
        )
    )
    laws = [(f"{model} inverse", "feedforward", model) for model in inverses]
    laws += [("PID", "pid", chosen), (f"{chosen} inverse + PID", "feedforward-pid", chosen)]
    loops: dict[str, Tracked] = {}
    uncompensated = before(inverses[chosen], rig, reference, approach=5.0, seed=seed).tracked
    if uncompensated is not None:
        loops[UNCOMPENSATED] = uncompensated
    for name, law, model in laws:
        with suppress(MckibbenError):
            controller = control_law(law, inverses[model], tuned)
            loops[name] = track(controller, rig, reference, approach=5.0, seed=seed)
    return loops


def _followed(tests: Sequence[Recording], outputs: Sequence[str], held: Sequence[str]) -> Recording:
    """Return a smoothed measured motion, with scheduling inputs at their means."""
    widest = max(tests, key=lambda run: min(float(np.ptp(run[name])) for name in outputs))
    step = sample_time_of(widest, "be tracked")
    n = min(len(widest), round(LONGEST_MOTION / step))
    width = max(round(HALF_WINDOW / step), 1)
    window = np.ones(width) / width
    smooth = {
        name: np.convolve(np.pad(widest[name][:n], width, mode="edge"), window, "same")[
            width : width + n
        ]
        for name in outputs
    }
    return Recording(smooth | {name: np.full(n, float(widest[name].mean())) for name in held}, step)

"""Studies: characterization, model choice, and inverse."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.channels import moved_by
from mckibben.checkpoints import Checkpoints
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.comparison.planning import plan_of
from mckibben.comparison.ranking import Standing, ranked
from mckibben.control import Tracked
from mckibben.diagnosis import Characterization, characterize
from mckibben.diagnosis.check import Validation
from mckibben.diagnosis.data_gaps import Gap, data_gaps
from mckibben.diagnosis.description import ModelDescription, describe
from mckibben.diagnosis.review import Review, review
from mckibben.errors import DataError
from mckibben.recording import COMMAND, Recording, listed
from mckibben.rigs import load_rig
from mckibben.studying.checking import check_on_test
from mckibben.studying.inverting import Compensation, compensation
from mckibben.studying.loops import closed_loops, named, recorded_rig
from mckibben.system.progress import telling
from mckibben.system.showing import DrawsItself


@dataclass(frozen=True, repr=False)
class Study(DrawsItself):
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

    def __repr__(self) -> str:
        return str(self)

    @property
    def input(self) -> str:
        """The input channel."""
        return self.leaderboard.input

    @property
    def output(self) -> str:
        """The output channel."""
        return self.leaderboard.output

    def to_dict(self) -> dict[str, Any]:
        """Return the results without models and their outputs."""
        known = self.characterization
        return {
            "characterization": None if known is None else known.to_dict(),
            "data_gaps": [gap.to_dict() for gap in self.data_gaps],
            "check": self.check.to_dict() if isinstance(self.check, Validation) else self.check,
            "description": None if self.description is None else self.description.to_dict(),
            "review": None if self.review is None else self.review.to_dict(),
            "leaderboard": self.leaderboard.to_dict(),
            "inverse": None if self.inverse is None else self.inverse.to_dict(),
            "passed_over": dict(self.passed_over),
            "tracking": {name: dict(tracked.rmse) for name, tracked in self.loops.items()},
        }


def study(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    *,
    rig: str | None = None,
    seed: int = 0,
    jobs: int | None = None,
    executor: Executor | None = None,
    folder: str | Path | None = None,
    clear: bool = True,
    progress: bool | Callable[[Standing], None] | None = None,
    found: Callable[[Study], None] | None = None,
    model: Block | None = None,
    compensator: Block | None = None,
    **choices: Any,
) -> Study:
    """Characterize recordings, choose a model by cross-validation, test it, and invert it if possible.

    The compensator is that of the first model in the order of the choice whose inverse is right, stays
    within the recorded inputs, and whose error on the test is clearly below that of a static map; see
    `mckibben.studying.inverting`. If no model is recommended, there is none.

    For several muscles, or under a load, a test motion is tracked on a virtual rig with every
    inverse, and with PID feedback. An interrupt ends the work at once; the study then has the
    finished results.

    Parameters
    ----------
    train, test, seed, jobs, executor, folder, clear, progress
        As for `compare`.
    rig : str, optional
        Virtual rig to close loops on; by default the rig of the recordings, with its changed
        parameters.
    found : callable, optional
        Called with the study so far: once the muscle is characterized, before any model is fitted,
        then whenever a model is finished.
    model, compensator : Block, optional
        Model and compensator of the loop logged in ``train``, which is then reviewed; see `review`.
    **choices
        Further arguments of `compare`.

    Returns
    -------
    Study

    Raises
    ------
    DataError
        On recordings that cannot be used.
    """
    recordings, tests = listed(train), listed(test)
    reviewed = None
    if model is not None or compensator is not None:  # the test is not for a refit to see
        reviewed = review(recordings, model=model, compensator=compensator, seed=seed)
        if choices.get("inputs") is None:
            recordings = [_driven(one) for one in recordings]
    plan = plan_of(recordings, tests, seed=seed, **choices)
    channels = plan.data.channels
    if rig is not None and channels.single:
        raise DataError(
            "loops are closed on a rig with recordings of several muscles, or under a load",
            remedy="leave `rig` out, or use `track()`",
        )
    looped, loop = channels.inputs, None
    if len(channels.inputs) == len(channels.outputs) == 1:
        looped = (moved_by([*recordings, *tests], looped[0]),)
        others = {*channels.inputs, *channels.scheduling} - set(looped)
        with suppress(DataError):  # of a load that follows the input, which is a data gap
            loop = characterize(
                [*recordings, *tests], looped[0], channels.outputs[0], scheduling=sorted(others)
            )
    so_far = Study(
        train=plan.data.split.train,
        test=plan.data.split.test,
        characterization=loop,
        leaderboard=plan.empty,
        predictions={},
        inverse=None,
        load=choices.get("load"),
        notes=plan.empty.notes,
        data_gaps=data_gaps(recordings, looped, channels.outputs, tests=tests),
        review=reviewed,
    )
    if found is not None:
        found(so_far)
    try:
        with (
            telling(progress, "studying", lines=True) as tell,
            closing(
                ranked(plan, jobs=jobs, executor=executor, folder=folder, progress=tell)
            ) as rankings,
        ):
            for ranking in rankings:
                so_far = replace(so_far, leaderboard=ranking.board, predictions=ranking.outputs)
                if ranking.board.pending and found is not None:
                    found(so_far)
    except KeyboardInterrupt:
        if not so_far.leaderboard.rows:
            raise
        return replace(so_far, leaderboard=replace(so_far.leaderboard, stopped=True))
    board = so_far.leaderboard
    if board.best is not None and board.best.block is not None:
        block, split, names = board.best.block, plan.data.split, channels.outputs
        on_test = so_far.predictions[board.best.model][len(split.train) :]
        so_far = replace(
            so_far,
            check=check_on_test(block, split, on_test, names),
            description=describe(block, split.train, fitted=True),
        )
    undone, passed_over = compensation(board, plan.data.split, seed)
    so_far = replace(so_far, inverse=undone, passed_over=passed_over)
    if not channels.single and undone is not None:
        try:
            plant = recorded_rig([*recordings, *tests]) if rig is None else load_rig(rig)
        except DataError as error:
            if rig is not None:
                raise
            plant, so_far = None, replace(so_far, not_looped=str(error))
        if plant is not None:
            try:
                loops = closed_loops(board, undone.model, plant, so_far.test, seed)
                so_far = replace(so_far, loops=loops, plant=named(plant))
            except DataError as error:
                so_far = replace(so_far, not_looped=str(error))
    if found is not None:
        found(so_far)
    if clear:
        Checkpoints(folder).clear()
    return so_far


def _driven(log: Recording) -> Recording:
    """Return a log with its commands as pressures, if these were not measured."""
    names = [name.removeprefix(COMMAND) for name in log.channels if name.startswith(COMMAND)]
    blind = [name for name in names if name not in log]
    units = {name: log.units[COMMAND + name] for name in blind}
    return log.with_channels(units, **{name: log[COMMAND + name] for name in blind})

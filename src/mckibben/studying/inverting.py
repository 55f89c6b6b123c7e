"""Compensators: the inverse of a model, tested once when it is made, and what is to be expected of it.

A compensator follows a motion as well as its model predicts the muscle, so what is expected of it is the
model's free-run error on the test. That the model follows behind its own inverse is required: it says
only that the inverse is right.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.fields import drives
from mckibben.blocks.force.feedforward import compensator
from mckibben.comparison.choosing import acceptable
from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.errors import MckibbenError, ModelError, ModelWarning
from mckibben.metrics import useful
from mckibben.recording import COMMAND, Recording
from mckibben.splits import Split
from mckibben.studying.recorded_inputs import RecordedInputs
from mckibben.studying.static_map import static_error

FOLLOWED = 1e-9
"""Largest error of a model behind its inverse, relative to the range of the motion."""

AFTERWARDS = 0.05
"""The same after a sample that the inverse clips, and says so: its memory is then off by that."""

PACES = (1.0, 10.0)
"""Times for which the input takes to run through its range, over the fastest recorded."""

MOST_OUTSIDE = 0.05
"""Largest share of the test's motion in which commands leave the inputs that were recorded."""


@dataclass(frozen=True)
class InverseCheck:
    """A random motion of a model, and of the model behind its inverse.

    Parameters
    ----------
    model : str
        Short name of the model inverted.
    inverse : Block
        The compensator.
    reference, pressure, output : array, shape (n, k)
        What the model does under random inputs; what the inverse gives for that; and what the model does
        then. With a dead time, outputs are later than the references by it.
    time : array, shape (n,)
    timed : bool
        Whether this is in seconds, and not sample numbers.
    error : float
        Largest difference between reference and output, relative to the reference's range, before the
        first sample that the inverse clips.
    error_afterwards : float
        The same over the whole motion.
    """

    model: str
    inverse: Block
    reference: Array
    pressure: Array
    output: Array
    time: Array
    timed: bool
    error: float
    error_afterwards: float


@dataclass(frozen=True)
class Compensation:
    """A compensator, and what is to be expected of it.

    Parameters
    ----------
    model : str
        Whose inverse it is.
    inverse : Block
        From desired outputs to inputs.
    unit : str
        Of the errors.
    following_error : float
        Predicted RMSE with which a muscle follows: the model's free-run error on the test.
    following_interval : (float, float) or None
        95 % interval of that.
    static_error : float
        Error of a static map on the same test; see `static_error`.
    check : InverseCheck
        Of the inverse on its own model.
    commands : tuple of str
        Recorded commands that are not the model's inputs: what lies between them and these, such as the
        lag of a regulator, is not in the error.
    """

    model: str
    inverse: Block
    unit: str
    following_error: float
    following_interval: tuple[float, float] | None
    static_error: float
    check: InverseCheck
    commands: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return whose it is, and its errors."""
        return {
            "model": self.model,
            "unit": self.unit,
            "following_error": self.following_error,
            "following_interval": self.following_interval and list(self.following_interval),
            "static_map_error": self.static_error,
            "inverse_error": self.check.error,
            "commands": list(self.commands),
        }


def compensation(
    board: Leaderboard, split: Split, seed: int = 0
) -> tuple[Compensation | None, Mapping[str, str]]:
    """Return the compensator of the first model of a leaderboard that has a good one.

    Parameters
    ----------
    board : Leaderboard
        Without a recommended model there is no compensator: one is as good as its model.
    split : Split
        The recordings of the leaderboard.
    seed : int
        Of the random motion of the check.

    Returns
    -------
    found : Compensation or None
    passed_over : mapping of str to str
        The models before it in the order of the choice, and why they have no compensator.
    """
    if board.best is None:
        return None, {}
    passed_over: dict[str, str] = {}
    judged = board.best.skill_least is not None
    plain = static_error(split, (*board.inputs, *board.loads), board.outputs)
    for row in board.rows:
        unvalidated = judged and row.skill_least is None  # the test must not decide
        if row.block is None or unvalidated or not acceptable(row, board.constant):
            continue
        try:
            return _of_row(row, row.block, board, split, plain, seed), passed_over
        except MckibbenError as error:
            passed_over[row.model] = str(error)
    return None, passed_over


def _of_row(
    row: Row, block: Block, board: Leaderboard, split: Split, plain: float, seed: int
) -> Compensation:
    """Return the compensator of a row; raise a `ModelError` where it has no good one."""
    inverse = compensator(block)
    if not drives(inverse.outputs[0]):
        raise ModelError("its inverse gives no input of a muscle", remedy="invert another model")
    if not np.isfinite(inverse.reachable()).all():
        raise ModelError(
            "it does not know the inputs that it was identified for, so its commands have no limits",
            remedy="invert another model",
        )
    if not useful(row.test_error, plain):
        raise ModelError(
            f"its error on the test, {row.test_error:.3g} {board.unit}, is not clearly below that of a "
            f"static map, {plain:.3g}",
            remedy="record more, or use the static map",
        )
    space = RecordedInputs.of(split.train, [channel.name for channel in block.inputs])
    check = checked(block, space, model=row.model, seed=seed)
    _refuse_unrecorded(check.inverse, split)
    return Compensation(
        row.model,
        check.inverse,
        board.unit,
        row.test_error,
        row.rmse_interval,
        plain,
        check,
        tuple(
            c for c in split.train[0].channels if c.startswith(COMMAND) and c not in board.inputs
        ),
    )


def checked(
    block: Block, space: RecordedInputs, *, model: str | None = None, seed: int = 0
) -> InverseCheck:
    """Return the compensator of a model, tested on a random motion, slow and fast.

    Parameters
    ----------
    block : Block
    space : RecordedInputs
        The inputs of that motion, their rate, and the sample time.
    model : str, optional
        Short name; default the block's kind.
    seed : int

    Raises
    ------
    ModelError
        If the model has no inverse, or does not follow behind it.
    """
    inverse, name = compensator(block), block.kind if model is None else model
    checks = [_check(name, block, inverse, space, pace, seed) for pace in PACES]
    for check in checks:
        if not (check.error <= FOLLOWED and check.error_afterwards <= AFTERWARDS):
            raise ModelError(
                f"its inverse misses a motion of the model by {check.error_afterwards:.1e} of the range",
                remedy="invert another model",
            )
    return checks[0]


def made(block: Block, sample_time: float | None = None) -> Block:
    """Return the compensator of a model, tested within its identified inputs where it knows them.

    Parameters
    ----------
    block : Block
    sample_time : float, optional
        At which it is tested [s]; default the model's own, or 20 ms.

    Raises
    ------
    ModelError
        As `checked`.
    """
    space = None if block.inverts else RecordedInputs.known(block, sample_time)
    return compensator(block) if space is None else checked(block, space).inverse


def _check(
    name: str, block: Block, inverse: Block, space: RecordedInputs, pace: float, seed: int
) -> InverseCheck:
    driven = space.motion(pace, seed)
    outputs = [channel.name for channel in block.outputs]
    given = [channel.name for channel in inverse.outputs]
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", ModelWarning)
        wanted = block.simulate(driven)
        asked = wanted.select([channel.name for channel in inverse.inputs])
        commands, kept = inverse.simulate(asked), _first_clipped(inverse, asked)
        again = driven.with_channels(**{name: commands[name] for name in given})
        found = block.simulate(again).matrix(outputs)
    reference = wanted.matrix(outputs)
    step, dead = space.sample_time, block.dead_time + inverse.dead_time
    late = 0 if step is None else round(dead / step)
    span = np.maximum(np.ptp(reference, axis=0), np.finfo(float).tiny)
    missed = np.abs(found[late:] - reference[: len(reference) - late]) / span
    return InverseCheck(
        model=name,
        inverse=inverse,
        reference=reference,
        pressure=commands.matrix(given),
        output=found,
        time=driven.time,
        timed=space.sample_time is not None,
        error=float(missed[: max(kept - late, 0)].max(initial=0.0)),
        error_afterwards=float(missed.max()),
    )


def _first_clipped(inverse: Block, asked: Recording) -> int:
    """Return the first sample of a motion at which a compensator clips; all if it never does."""
    if not inverse.n_clipped(inverse.final_state(asked)):
        return len(asked)
    stream = inverse.stream(asked.sample_time, initial=inverse.start_on(asked).tolist())
    for place, row in enumerate(asked.matrix([channel.name for channel in inverse.inputs])):
        stream.step(row)
        if stream.status & Stream.CLIPPED:
            return place
    return len(asked)


def _refuse_unrecorded(inverse: Block, split: Split) -> None:
    """Raise a `ModelError` if commands for the test's motion are no inputs as those of training."""
    needed = [channel.name for channel in inverse.inputs]
    names = [channel.name for channel in inverse.outputs]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        commands = [
            inverse.simulate(recording.with_derived(needed).select(needed)).matrix(names)
            for recording in split.test
        ]
    share = RecordedInputs.of(split.train, names).outside(np.concatenate(commands))
    if share > MOST_OUTSIDE:
        raise ModelError(
            f"its commands for the test's motion leave the recorded combinations of "
            f"{', '.join(names)} in {100 * share:.0f} % of the samples",
            remedy="record these too, or invert another model",
        )

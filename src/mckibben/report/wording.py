"""Numbers and sentences of the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mckibben.comparison.choosing import acceptable
from mckibben.metrics import Scores
from mckibben.numerals import numeral, typeset
from mckibben.report import words

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Leaderboard, Row
    from mckibben.recording import Recording
    from mckibben.studying.inverting import InverseCheck
    from mckibben.studying.study import Study

WORSE_ON_TEST = 1.5
"""Test error over training error from which more varied data are asked for."""

FORGETFUL = 0.7
"""Share of the measured branch gap below which a model is said to forget."""

MISLEADING = 0.05
"""RMSE over range from which the chosen model is said to miss something."""


MISSING = 0.1
"""Largest error of an inverse over the range, on its own model, from which it is no feedforward."""

ROUNDING = 1e-9
"""Share that is rounding, and shown as none."""


def number(value: float | None, digits: int = 3) -> str:
    """Return a number to so many significant digits, as it is printed.

    >>> number(-12345.6), number(None)
    ('−12346', '–')
    """
    return typeset(numeral(value, digits))


def percent(value: float | None, digits: int = 2) -> str:
    """Return a share as a percentage.

    >>> percent(0.0123), percent(-1.8e-15), percent(None)
    ('1.2 %', '0 %', '–')
    """
    if value is None:
        return "–"
    shown = 0.0 if abs(value) < ROUNDING else value
    return f"{number(100 * shown, digits)} %"


def of_test_range(test: Scores) -> str:
    """Return an error as a share of the range of what it was tested on, as words that follow it.

    >>> of_test_range(Scores(0.02, 0.01, 0.9, 0.1, 0.034, 3.0))
    ', 3.4 % of the range of the test'
    """
    return "" if np.isnan(test.nrmse) else f", {percent(test.nrmse)} of the range of the test"


def verdict(study: Study) -> list[str]:
    """Return which model is chosen and by what, its test error, and whether it can be inverted."""
    board, best = study.leaderboard, study.leaderboard.best
    if best is None or best.test is None:
        if board.not_recommended:
            n_ok = sum(row.reason is None for row in board.rows)
            return [
                f"Models that worked{' so far' if board.pending else ''}: {n_ok}. {words.chosen(board)}"
            ]
        if board.pending:
            return ["No model is fitted yet."]
        return ["No model could be identified on these recordings."]
    n_ok = sum(row.reason is None for row in board.rows)
    between = ""
    if best.rmse_interval is not None:
        low, high = best.rmse_interval
        between = f" (95 % interval {number(low)} to {number(high)} {board.unit})"
    so_far = " so far" if board.pending else ""
    sentences = [
        f"Models that worked{so_far}: {n_ok}. {words.chosen(board)}",
        f"Free-running on the test data{_untouched(board)}, {best.model} is "
        f"off by {number(best.test.rmse)} {board.unit} RMSE{between}{of_test_range(best.test)}; "
        f"at worst by {number(best.test.max_error)} {board.unit}.",
    ]
    if board.level:
        sentences.append(f"{_listed(board.level)}: {words.LEVEL}.")
    if best.caution is not None:
        sentences.append(
            f"{best.model} is good only near the motions it was fitted to: {best.caution}."
        )
    return [*sentences, _invertibility(study, best)]


def _untouched(board: Leaderboard) -> str:
    return "" if board.shared else ", which it was neither fitted to nor chosen by"


def cautions(board: Leaderboard) -> dict[str, str]:
    """Return the models of a leaderboard that are good only near what they were fitted to, and why."""
    return {row.model: row.caution for row in board.rows if row.reason is None and row.caution}


def _invertibility(study: Study, best: Row) -> str:
    check = study.inverse
    if check is None and study.leaderboard.pending:
        return "The first of the leaderboard that can be inverted is inverted when all are fitted."
    if check is None:
        return "None of the models that worked can be inverted."
    which = another_inverted(study) or "It can be inverted"
    if check.reachable is None:
        motion = "what the model makes of the test" if check.own else "the test's motion"
        share = percent(check.error)
        return f"{which}: on the model itself, it follows {motion} to {share} of its range."
    low, high = check.reachable
    return (
        f"{which}: any {study.output} from {number(low)} to {number(high)} "
        f"{study.leaderboard.unit} can be asked for, whatever happened before."
    )


def another_inverted(study: Study) -> str:
    """Return why not the chosen model is inverted, but another, and its error; empty where it is."""
    best, check = study.leaderboard.best, study.inverse
    if best is None or check is None or check.model == best.model:
        return ""
    (other,) = (row for row in study.leaderboard.rows if row.model == check.model)
    times = numeral(other.test_error / max(best.test_error, 1e-300), 2)
    lacks = "has no inverse" if best.inverse is None else "cannot be inverted on these data"
    return (
        f"{best.model} {lacks}; the first after it that has one is {check.model}, with {times} "
        "times its test error"
    )


def _better_on_the_test(board: Leaderboard) -> str:
    """Return which models beat the mean on the test, though none is recommended, in words."""
    rows = [row for row in board.rows if acceptable(row, board.constant)]
    told = [f"{row.model} is off by {number(row.test_error)} {board.unit}" for row in rows]
    mean = board.constant.test_error if board.constant else 0.0
    return f"{' and '.join(told)}, the mean by {number(mean)} {board.unit}" if told else ""


def next_steps(study: Study) -> list[str]:
    """Return what to do next, most useful first."""
    best, pending = study.leaderboard.best, study.leaderboard.pending
    if pending:
        done, left = len(study.leaderboard.rows), len(pending)
        return [
            f"Load this page again while models are fitted: {done} of {done + left} are done, "
            f"{_listed(pending)} to come. If the work was stopped, the same command goes on."
        ]
    if study.leaderboard.not_recommended:
        if others := _better_on_the_test(study.leaderboard):
            return [
                f"On the test, {others}. But what a test has chosen, it has not tested: record more "
                "that moves as the test does, and fit again; or test that model on another run."
            ]
        return [
            "Use none of these models. Check that input and output are the right channels, that the "
            "sensor of the output was connected, and that several cycles are covered; then record again."
        ]
    if best is None or best.test is None or best.train is None:
        return [
            "Read the reasons in the leaderboard below, then check that input and output are the "
            "right channels and that the recording covers several cycles."
        ]
    steps = []
    if study.inverse is not None:
        steps.append(_feedforward(study, study.inverse, best))
    if best.test.nrmse > MISLEADING:
        steps.append(
            "The chosen model still misses something: the residuals below show whether it depends on "
            "the input (a wrong shape) or on time (creep, rate)."
        )
    if best.train.rmse > 0 and best.test.rmse > WORSE_ON_TEST * best.train.rmse:
        ratio = number(best.test.rmse / best.train.rmse, 2)
        steps.append(
            f"The error on new data is {ratio} times that on the data fitted: record more varied "
            "movements, with turning points at many levels, and fit again."
        )
    memory = best.memory
    if memory is not None and memory.gap_ratio is not None and memory.gap_ratio < FORGETFUL:
        steps.append(
            f"It keeps only {percent(memory.gap_ratio)} of the recorded gap between branches: do "
            "not rely on it where the input is held."
        )
    if not steps:
        steps.append(
            "Test the model on a recording made on another day or with another load (--test)."
        )
    return steps


def _feedforward(study: Study, check: InverseCheck, best: Row) -> str:
    """Return that the inverse can be used as feedforward, or why it had better not be."""
    (row,) = (row for row in study.leaderboard.rows if row.model == check.model)
    if row.validation_rmse is None:
        doubt = "the model has no cross-validated error"
    elif not check.error <= MISSING:
        doubt = f"on the model itself it is off by up to {percent(check.error)} of the range"
    else:
        doubt = ""
    if doubt:
        return f"Do not rely on the inverse, that of {check.model}, as feedforward: {doubt}."
    of = "" if check.model == best.model else f" of {check.model}"
    return (
        f"Use the inverse{of} as feedforward: inverse.json turns a wished-for {study.output} into "
        f"{check.given} (command at the end). On the muscle itself expect the error of "
        f"{check.model if of else 'the model'}, not of the inverse."
    )


def versions() -> dict[str, str]:
    """Return the versions of Python, this package, and those that its numbers come from."""
    import platform
    from importlib.metadata import version

    packages = ("mckibben", "numpy", "scipy", "numba")
    return {"Python": platform.python_version()} | {name: version(name) for name in packages}


def _listed(names: Sequence[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


def duration(recording: Recording) -> str:
    """Return how long a recording is, in words."""
    samples = f"{recording.n_samples} samples"
    if recording.duration is None or recording.sample_time is None:
        return f"{samples}, no time"
    step = recording.sample_time
    pace = f"at {number(1 / step)} Hz" if step < 1 else f"every {number(step)} s"
    return f"{samples}, {number(recording.duration)} s {pace}"

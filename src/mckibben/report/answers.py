"""What a person asks who has a model: is it right, how far off may it be, what to record next."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben.diagnosis.check import Validation
from mckibben.report.wording import number, of_test_range, percent
from mckibben.report.words import check_sentences, check_verdict, gap_run, gap_sentence

if TYPE_CHECKING:
    from mckibben.studying.study import Study

MOST = 2
"""Things said of each."""


SHORT = 0.03
"""By which a band may hold less of the test than it should, unsaid."""


def right(study: Study) -> list[str]:
    """Return whether the chosen model is right, the most important first."""
    best, check = study.leaderboard.best, study.check
    if best is None:
        return ["No model is chosen, so there is nothing to check."]
    if check is None:
        return ["The chosen model is checked when all are fitted."]
    if not isinstance(check, Validation):
        return [f"That cannot be told: {check}"]
    return [check_verdict(check), *check_sentences(check)[:MOST]]


def how_far(study: Study) -> list[str]:
    """Return how far off the chosen model may be on a new run."""
    board = study.leaderboard
    best = board.best
    if best is None or best.test is None:
        return ["No model is chosen."]
    largest = f"At worst it was off by {number(best.test.max_error)} {board.unit} on the test."
    band = best.band
    if band is None:
        share = of_test_range(best.test)
        return [
            f"On the test it is off by {number(best.test.rmse)} {board.unit} RMSE{share}. For a band "
            "around it: mckibben calibrate, on runs that it was not fitted to.",
            largest,
        ]
    said = []
    for name, width in band.width.items():
        of = f"{name} was" if len(band.width) > 1 else "the muscle was"
        inside, asked = percent(band.coverage[name]), percent(band.level)
        scaled = width < 0.95 * band.constant_width[name]
        by = ", narrower and wider by the state of motion" if scaled else ""
        around = f"within about ±{number(width / 2, 2)} {board.unit} of the model{by}"
        if band.coverage[name] < band.level - SHORT:
            said.append(
                f"Further than its errors in cross-validation say: a band for {asked} of the samples "
                f"held {inside} of the test, where {of} to be {around}. Calibrate it on runs like "
                "those to come: mckibben calibrate."
            )
        else:
            said.append(
                f"In {inside} of the test's samples {of} {around}, a band for {asked}. Expect the like "
                "of runs like the test."
            )
    return [*said, largest]


def record_next(study: Study) -> list[str]:
    """Return which runs would tell most of what is not known yet."""
    gaps = [f"{gap_sentence(gap)} {gap_run(gap)}" for gap in study.untold[:MOST]]
    if not gaps:
        gaps = ["No data gaps were found."]
    if study.leaderboard.best is not None:
        gaps.append("mckibben plan writes that motion; its command is at the end.")
    return gaps


def answers(study: Study) -> tuple[tuple[str, list[str]], ...]:
    """Return the three questions, each with what is told."""
    return (
        ("Is it right?", right(study)),
        ("How far off may it be?", how_far(study)),
        ("What to record next?", record_next(study)),
    )

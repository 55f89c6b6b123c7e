"""Sentences: of few words, and each from the numbers of a result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

import mckibben
from mckibben.diagnosis.data_gaps import data_gaps
from mckibben.diagnosis.description import describe
from mckibben.numerals import percent
from mckibben.report import words
from mckibben.report.columns import columns_of
from mckibben.report.glossary import definition
from mckibben.studying.study import Study
from tests.report.studies_by_hand import hung, plain_study, two_muscles

MOST_WORDS = 60


def one_muscle() -> Study:
    found = plain_study()
    best = found.leaderboard.best
    assert best is not None
    assert best.block is not None
    return replace(
        found,
        data_gaps=data_gaps(found.train, ("pressure",), ("displacement",)),
        check=mckibben.check(best.block, found.test),
        description=describe(best.block, found.train),
    )


def several_muscles() -> Study:
    runs = [two_muscles(5.0, 0), two_muscles(4.0, 2)]
    return mckibben.study(runs, two_muscles(4.5, 4), models=["coupled-memory"], jobs=1)


def under_a_load() -> Study:
    runs = [hung(10.0, 0), hung(20.0, 1)]
    return mckibben.study(runs, hung(15.0, 2), load="force", models=["play-ridge"], jobs=1)


@pytest.mark.parametrize("make", [one_muscle, several_muscles, under_a_load])
def test_the_three_answers_are_short_and_hold_their_numbers(make: Callable[[], Study]) -> None:
    found = make()
    said = words.answers(found)
    assert sum(len(sentence.split()) for _, sentence in said) <= MOST_WORDS
    best = found.leaderboard.best
    assert best is not None
    band = best.band
    if band is None:
        return
    numbers = {
        None: percent(min(band.coverage.values())),
        "blocks": f"{band.units} ",
        "branches": f"{band.branches} ",
        "narrow": percent(band.lowest),
        "wide": percent(band.highest),
    }
    assert numbers[band.unknown] in said[1][1]


def test_every_column_of_a_leaderboard_is_in_the_glossary() -> None:
    row = plain_study().leaderboard.rows[0].to_dict()
    every = [one for by in words.CHOICES for one in columns_of([row], "mm", chosen_by=by)]
    assert len(every) > 20
    assert [one.label for one in every if not definition(one.label)] == []

"""What shows itself: texts for a terminal, cards for a notebook, and plots."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import mckibben
from mckibben import Recording, example
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.control import track
from mckibben.errors import MckibbenError, in_terms_of
from mckibben.report.text import lines_of_result
from mckibben.system.showing import DrawsItself, Result

EVIL = '<img src=x onerror="alert(1)">\x1b[2J'


@pytest.fixture(autouse=True)
def without_windows() -> Iterator[None]:
    mpl.use("Agg")
    yield
    from matplotlib import pyplot

    pyplot.close("all")


@pytest.fixture(scope="module")
def train() -> Recording:
    return mckibben.read(example.TRAIN)[0]


@pytest.fixture(scope="module")
def board(train: Recording) -> Leaderboard:
    (test,) = mckibben.read(example.TEST)
    return mckibben.compare(train, test, models=["pi", "gpi", "force-chou"], jobs=1)


@pytest.fixture(scope="module")
def things(train: Recording, board: Leaderboard) -> dict[str, Any]:
    assert board.best is not None
    model = board.best.block
    assert model is not None
    rig = mckibben.load_rig("mas20-hanging")
    wished = Recording({"displacement": 10 + 5 * np.sin(np.arange(100) * 0.1)}, 0.05)
    return {
        "recording": train,
        "leaderboard": board,
        "characterization": mckibben.characterize([train]),
        "model": model,
        "compensator": model.inverse(),
        "rig": rig,
        "arm": mckibben.load_rig("soft-arm"),
        "tracked": track(model.inverse(), rig, wished, approach=1.0),
        "validation": mckibben.check(model, train),
        "study": mckibben.study(train, models=["pi"], jobs=1),
    }


def test_they_print_as_commands_do_and_cards_bring_nothing_along(things: dict[str, Any]) -> None:
    for name, thing in things.items():
        lines = str(thing).splitlines()
        if isinstance(thing, Result):
            assert lines == in_terms_of("\n".join(lines_of_result(thing))).splitlines(), name
        else:
            assert 1 < len(lines) <= 3, name
            assert max(map(len, lines)) <= 80, name
        card = thing._repr_html_()
        assert len(card) < 12_000, name
        assert not re.search(r"<script|https?:|src=|url\(|on\w+=", card), name


def test_they_are_drawn(things: dict[str, Any]) -> None:
    for name, thing in things.items():
        if name != "validation":
            assert isinstance(thing, DrawsItself), name
            first, *_ = np.ravel(np.asarray(thing.plot(), dtype=object))
            assert first.has_data(), name


def test_a_leaderboard_is_a_table(board: Leaderboard) -> None:
    table = board.to_frame()
    assert {"model", "validation_rmse", "test.rmse"} <= set(table.columns)
    assert str(board) == repr(board)
    assert re.findall(r"<tr><td[^>]*>([^<]+)<", board._repr_html_()) == ["gpi", "pi", "constant"]


def test_figures_refuse_what_they_do_not_take(things: dict[str, Any], train: Recording) -> None:
    for thing, kind, choices in (
        (things["recording"], "loops", {}),
        (things["model"], "loop", {"recording": train}),
        (things["leaderboard"], "fit", {"recording": train, "models": "force-chou"}),
        (things["leaderboard"], "fit", {}),
        (things["validation"], "residual", {"against": "nothing"}),
    ):
        with pytest.raises(MckibbenError) as refused:
            thing.plot(kind, **choices)
        assert refused.value.remedy


@pytest.mark.parametrize("name", ["model", "leaderboard"])
def test_a_recording_is_compared_with_by_default(
    things: dict[str, Any], train: Recording, name: str
) -> None:
    (axis,) = np.ravel(things[name].plot(recording=train))
    assert [line.get_label() for line in axis.lines] == [
        train.origin,
        "model" if name == "model" else "gpi",
    ]


def test_names_are_shown_verbatim_and_never_obeyed() -> None:
    ramp = np.array([0.0, 1.0, 2.0, 1.0])
    evil = Recording(
        {"pressure": ramp, "displacement": ramp, EVIL: ramp}, meta={"name": EVIL, "notes": [EVIL]}
    )
    card = evil._repr_html_()
    assert "<img" not in card
    assert "\x1b" not in card
    evil.plot("time")

"""What shows itself: texts for a terminal, cards for a notebook, and plots."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import mckibben
from mckibben import DataError, MckibbenError, ModelError, Recording, example
from mckibben.comparison.results import Leaderboard
from mckibben.control import track
from mckibben.registry import load, names
from mckibben.system.showing import DrawsItself

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


NAMES = (
    *("recording", "leaderboard", "characterization", "model", "compensator", "rig", "arm"),
    *("tracked", "validation", "study"),
)


@pytest.mark.parametrize("name", NAMES)
def test_it_prints_within_a_terminal(name: str, things: dict[str, Any]) -> None:
    lines = str(things[name]).splitlines()
    assert len(lines) > 2
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("name", NAMES)
def test_its_card_is_short_and_brings_nothing_along(name: str, things: dict[str, Any]) -> None:
    card = things[name]._repr_html_()
    assert len(card) < 12_000
    assert not re.search(r"<script|https?:|src=|url\(|on\w+=", card)
    assert "color:#" not in card, "a colour of its own is unreadable in light or dark"


@pytest.mark.parametrize("name", [name for name in NAMES if name != "validation"])
def test_it_is_drawn_in_both_ways(name: str, things: dict[str, Any]) -> None:
    thing = things[name]
    assert isinstance(thing, DrawsItself)
    first, *_ = np.ravel(np.asarray(thing.plot(), dtype=object))
    figure = thing.interactive()
    assert first.has_data()
    assert len(figure.data) == len([*first.lines, *first.collections]) or len(figure.data) > 0
    assert not re.search(r'"--[a-z]', figure.to_json()), "a colour was left as a name"


@pytest.mark.parametrize("kind", names("blocks"))
def test_every_block_says_what_it_is(kind: str) -> None:
    block = load("blocks", kind).example()
    assert block.inputs[0].name in str(block)
    assert max(map(len, str(block).splitlines())) <= 80
    assert block._repr_html_().startswith("<div")


def test_a_leaderboard_is_a_table(board: Leaderboard) -> None:
    table = board.to_frame()
    assert {"model", "validation_rmse", "test.rmse"} <= set(table.columns)
    assert str(board) == repr(board)
    ranked = [line.split() for line in str(board).splitlines()]
    assert [words[1] for words in ranked if words and words[0].isdigit()] == ["gpi", "pi"]


def test_measured_is_drawn_beside_modelled(train: Recording, board: Leaderboard) -> None:
    axis = board.plot(recording=train)
    assert [text.get_text() for text in axis.get_legend().get_texts()] == ["virtual", "gpi"]
    both = board.plot("fit", recording=train, models=["gpi", "pi"])
    assert {text.get_text() for text in both.get_legend().get_texts()} == {"virtual", "gpi", "pi"}


def test_it_is_drawn_into_axes_that_are_given(train: Recording) -> None:
    from matplotlib.figure import Figure

    axes = Figure().subplots(2)
    assert train.plot("loop", ax=axes[0]) is axes[0]
    with pytest.raises(DataError):
        train.plot("time", ax=axes[0])
    assert train.plot("time", ax=axes) == list(axes)
    assert train.plot("time", output="displacement", ax=axes[1]) is axes[1]


@pytest.mark.parametrize(
    ("kind", "choices", "named"),
    [
        ("nonsense", {}, "errors, loops"),
        ("fit", {}, "recording="),
        ("fit", {"recording": True, "models": "mpi"}, "gpi, pi"),
    ],
)
def test_what_cannot_be_drawn_is_refused_and_what_can_is_named(
    kind: str, choices: dict[str, Any], named: str, board: Leaderboard, train: Recording
) -> None:
    given = choices | ({"recording": train} if choices else {})
    with pytest.raises(ModelError, match=named):
        board.plot(kind, **given)


def test_names_are_shown_verbatim_and_never_obeyed(tmp_path: Path) -> None:
    ramp = np.array([0.0, 1.0, 2.0, 1.0])
    evil = Recording(
        {"pressure": ramp, "displacement": ramp, EVIL: ramp}, meta={"name": EVIL, "notes": [EVIL]}
    )
    card = evil._repr_html_()
    assert "<img" not in card
    assert "\x1b" not in card
    evil.plot("time")
    assert "<img" not in evil.interactive("time").layout.yaxis3.title.text


@pytest.mark.parametrize(("method", "lacking"), [("plot", "matplotlib"), ("interactive", "plotly")])
def test_what_draws_it_may_be_missing(
    method: str, lacking: str, train: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, lacking, None)  # as if it were not installed
    with pytest.raises(MckibbenError, match=r"pip install .*mckibben\[(figures|notebook)\]"):
        getattr(train, method)()


def test_a_recording_of_several_muscles_and_one_without_motion() -> None:
    ramp, still = np.array([0.0, 1.0, 2.0]), np.array([1.0, 1.0, 1.0])
    several = Recording({"pressure_1": ramp, "displacement_1": ramp})
    assert several.plot().get_xlabel() == "pressure_1 [bar]"
    held = Recording({"pressure": still, "temperature": ramp}, 0.1)
    assert len(held.plot()) == 2  # over time
    assert "svg" not in held._repr_html_()

"""All words of the report, of five small studies, as they were last accepted.

Whoever changes a sentence reads what has changed and accepts it: ``python -m
tests.report.test_sentences --accept``. What stands in the first file is left out of the others.
"""

from __future__ import annotations

import difflib
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import PI, Recording
from mckibben.comparison.leaderboard import Row
from mckibben.comparison.memory_test import Memory
from mckibben.control import Twin, track
from mckibben.diagnosis.data_gaps import data_gaps
from mckibben.diagnosis.description import describe
from mckibben.report.page import page
from mckibben.report.wording import next_steps, verdict
from mckibben.studying.study import Study
from tests.report.studies_by_hand import QUICKLY, TIME, hung, study, two_muscles

FOLDER = Path(__file__).parent / "sentences"
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")


class Words(HTMLParser):
    """The lines of words of a page: what is no part of a sentence ends a line."""

    INLINE = frozenset({"a", "abbr", "code", "em", "small", "span", "strong", "sub", "sup"})
    HIDDEN = frozenset({"math", "script", "style", "svg"})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.text, self.hidden = "", 0
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.hidden += tag in self.HIDDEN
        self.text += "" if tag in self.INLINE else " | " if tag in ("td", "th") else "\n"

    def handle_endtag(self, tag: str) -> None:
        self.hidden -= tag in self.HIDDEN
        self.text += "" if tag in {*self.INLINE, "td", "th"} else "\n"

    def handle_data(self, data: str) -> None:
        if not self.hidden:
            self.text += data.replace("\n", " ")


def lines(text: str) -> list[str]:
    """Return the lines of a text, with versions left out and numbers rounded."""

    def rounded(found: re.Match[str]) -> str:
        return np.format_float_positional(float(f"{float(found[0]):.3g}"), trim="-")

    for package in ("mckibben", "numpy", "scipy", "numba"):
        text = text.replace(f"{package} {version(package)}", package)
    text = text.replace(sys.version.split()[0], "")
    every = (NUMBER.sub(rounded, " ".join(line.split())).strip(" |") for line in text.splitlines())
    return [line for line in every if line]


def steady(found: Study) -> Study:
    """Return a study without times, which are the machine's, and parameters that data hardly fix."""
    rows = tuple(replace(row, fit_seconds=1.0, step_ns=10.0) for row in found.leaderboard.rows)
    board = replace(found.leaderboard, rows=rows)
    return replace(found, leaderboard=board, description=None)


def one_muscle() -> Study:
    found = study(notes=("Time was resampled: jitter 3 %.",))
    best = found.leaderboard.best
    assert best is not None
    assert best.block is not None
    return replace(
        found,
        untold=data_gaps(found.train, ("pressure",), ("displacement",)),
        check=mckibben.check(best.block, found.test),
        description=describe(best.block, found.train),
    )


def several_muscles() -> Study:
    runs = [two_muscles(5.0, 0), two_muscles(4.0, 2)]
    return mckibben.study(runs, two_muscles(4.5, 4), models=["coupled-memory"], jobs=1)


def under_a_load() -> Study:
    runs = [hung(10.0, 0), hung(20.0, 1)]
    return mckibben.study(
        runs, hung(15.0, 2), load="force", models=["balance"], settings=QUICKLY, jobs=1
    )


def at_held_lengths() -> Study:
    def held(length: float, seed: int) -> Recording:
        pressure = 2.5 + 2 * np.sin(TIME * (2.0 - 0.2 * seed))
        friction = 5 * np.sign(np.gradient(pressure))
        noise = 0.5 * np.random.default_rng(seed).standard_normal(TIME.size)
        force = 40 * pressure - 30 * length + friction + noise
        channels = {"pressure": pressure, "displacement": np.full(TIME.size, length)}
        return Recording(channels | {"force": force}, 0.05, meta={"name": f"at {length:g} mm"})

    runs = [held(0.0, 0), held(1.0, 1)]
    return mckibben.study(
        runs, held(0.5, 2), inputs="pressure", outputs="force", models=["pi"], jobs=1
    )


def robots_log() -> Study:
    muscle = PI.example()
    weaker = replace(muscle, weights=tuple(0.9 * weight for weight in muscle.weights))
    (low,), (high,) = muscle.reachable()
    wave = 0.5 * (low + high) + 0.3 * (high - low) * np.sin(TIME)
    wished = Recording({"displacement": wave}, 0.05)
    log = track(muscle.inverse(), Twin(weaker), wished, seed=0).recording
    return mckibben.study(log, models=["pi"], model=muscle, jobs=1)


STUDIES: dict[str, Callable[[], Study]] = {
    one.__name__.replace("_", "-"): one
    for one in (one_muscle, several_muscles, under_a_load, at_held_lengths, robots_log)
}


def states() -> Iterator[tuple[str, Study]]:
    """Give what may become of a study, each by what is otherwise than usual."""
    whole = study()
    board, (best, second, *others) = whole.leaderboard, whole.leaderboard.rows
    assert best.test is not None
    assert second.test is not None
    assert whole.inverse is not None

    def ranked(*rows: Row, of: Study = whole, **changed: Any) -> Study:
        return replace(of, leaderboard=replace(board, rows=rows, **changed))

    def off_by(row: Row, rmse: float) -> Row:
        assert row.test is not None
        return replace(row, test=replace(row.test, rmse=rmse))

    other = replace(whole, inverse=replace(whole.inverse, model="pi"))
    bad = replace(best, test=replace(best.test, rmse=5.0, nrmse=0.5), memory=Memory(0.2, 10, 1.0))
    constant = replace(off_by(second, 5.0), model="constant")
    tied = replace(second, difference_interval=(-0.1, 0.1))
    unvalidated = [replace(row, validation_rmse=None) for row in board.rows[1:]]
    pending = replace(whole, inverse=None)
    yield "usual", whole
    yield "another model is inverted", other
    yield (
        "the chosen one has no inverse",
        ranked(replace(best, block=None), *board.rows[1:], of=other),
    )
    yield "the inverted one is not validated", ranked(best, *unvalidated, of=other)
    yield "the inverse is off", replace(whole, inverse=replace(whole.inverse, error=0.3))
    yield "none is inverted", pending
    yield "another has the lowest test error", ranked(second, best, *others)
    yield "two tie", ranked(best, tied, *others)
    yield "the chosen one is bad", ranked(bad, second, *others)
    astray = off_by(best, 9.0)
    yield "one beats the mean", ranked(astray, off_by(second, 1.0), constant=constant)
    yield "none is recommended", ranked(astray, off_by(second, 6.0), constant=constant)
    yield "none worked", study(blocks={})
    yield "some are to come", ranked(*board.rows, of=pending, pending=("cpi", "kp"))
    yield "none is fitted yet", ranked(of=pending, pending=("cpi", "kp"))


@cache
def written(name: str) -> tuple[str, ...]:
    """Return the words of a study as lines: its page, and what it prints."""
    if name == "states":
        said = {
            state: lines("\n".join([*verdict(one), *next_steps(one)])) for state, one in states()
        }
        usual, *others = said
        words = [*said[usual]]
        for state in others:
            words += [f"# {state}", *(line for line in said[state] if line not in said[usual])]
        return tuple(words)
    first = next(iter(STUDIES))
    found = STUDIES[name]() if name == first else steady(STUDIES[name]())
    words = [*lines(Words(page(found)).text), "# printed", *lines(str(found))]
    known: Sequence[str] = () if name == first else written(first)
    return tuple(line for line in words if line not in known)


def stored(name: str) -> list[str]:
    return (FOLDER / f"{name}.txt").read_text("utf-8").splitlines()


def same(one: str, other: str) -> bool:
    """Return whether lines have the same words and nearly the same numbers."""
    if NUMBER.sub("0", one) != NUMBER.sub("0", other):
        return False
    found, wanted = ([float(each) for each in NUMBER.findall(line)] for line in (one, other))
    return found == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("name", [*STUDIES, "states"])
def test_words_are_those_that_were_accepted(name: str) -> None:
    found, wanted = list(written(name)), stored(name)
    if len(found) == len(wanted):
        found = [old if same(new, old) else new for new, old in zip(found, wanted, strict=True)]
    assert found == wanted, "\n".join(difflib.unified_diff(wanted, found, lineterm="", n=0))


if __name__ == "__main__":
    if sys.argv[1:] != ["--accept"]:
        sys.exit("say --accept to write what the report says now")
    FOLDER.mkdir(exist_ok=True)
    for each in (*STUDIES, "states"):
        (FOLDER / f"{each}.txt").write_text("\n".join(written(each)) + "\n", "utf-8")

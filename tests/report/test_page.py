from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mckibben.blocks.play_type.gpi import GPI
from mckibben.blocks.play_type.pi import PI
from mckibben.recording import Recording
from mckibben.report import coupling_subjects, write_report
from mckibben.report.coupling_subjects import Coupling
from mckibben.report.page import page
from mckibben.studying.study import Study
from tests.report.studies_by_hand import measured, models, renamed, study
from tests.tools import needs, where

SECTIONS = (
    "headline",
    "recordings",
    "characterization",
    "leaderboard",
    "fit",
    "residuals",
    "weights",
    "inverse",
    "method",
)
VOID = {"meta", "link", "input", "br", "img"}
LOADING = {"src", "srcset", "href", "action", "poster", "data", "formaction", "xlink:href"}


class Parsed(HTMLParser):
    """A page: its attributes, its words outside scripts, its scripts; nesting is checked."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.scripts: list[str] = []
        self.words = ""
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag == "script":
            self.scripts.append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts[-1] += data
        elif not self.open or self.open[-1] != "style":
            self.words += data

    @property
    def ids(self) -> list[str]:
        return [value for _, name, value in self.attributes if name == "id"]

    @property
    def figures(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.scripts[0])
        return found


@pytest.fixture(scope="module")
def whole() -> Study:
    return study(notes=("Time was resampled: jitter 3 %.",))


@pytest.fixture(scope="module")
def parsed(whole: Study) -> Parsed:
    return Parsed(page(whole))


def test_the_page_parses_and_has_every_section(parsed: Parsed) -> None:
    assert set(SECTIONS) <= set(parsed.ids)
    assert len(parsed.ids) == len(set(parsed.ids))
    linked = {v[1:] for tag, name, v in parsed.attributes if tag == "a" and name == "href"}
    assert linked <= set(parsed.ids)


def test_every_plot_has_its_data_and_a_label(parsed: Parsed) -> None:
    wanted = {value for _, name, value in parsed.attributes if name == "data-figure"}
    assert wanted == set(parsed.figures)
    plots = sum(name == "data-panel" for _, name, _ in parsed.attributes)
    assert plots == sum(len(variants[0]) for variants in parsed.figures.values())
    assert sum(name == "aria-label" for _, name, _ in parsed.attributes) >= plots


def test_nothing_is_loaded_from_elsewhere(parsed: Parsed) -> None:
    for _, name, value in parsed.attributes:
        if name in LOADING:
            assert value.startswith(("#", "data:"))
        assert "url(" not in value
    policy = [v for t, name, v in parsed.attributes if t == "meta" and name == "content"]
    assert any(value.startswith("default-src 'none'") for value in policy)
    style = files("mckibben.report").joinpath("templates/report.css").read_text()
    assert not re.search(r"url\(|@import|https?:", style)


def test_every_colour_of_the_plots_is_in_the_style_in_light_and_dark(parsed: Parsed) -> None:
    style = files("mckibben.report").joinpath("templates/report.css").read_text()
    used = set(re.findall(r'"(--[a-z0-9-]+)"', parsed.scripts[0]))
    assert used
    for colour in used:
        assert style.count(f"{colour}: #") == 2


def test_what_was_found_is_said_with_units(parsed: Parsed, whole: Study) -> None:
    assert whole.characterization is not None
    for words in (*whole.characterization.sentences, *whole.notes, "gpi", "[mm]", "seed 0"):
        assert words in parsed.words
    assert "eupi" in parsed.words
    assert "failed: the data have no time. Remedy: give --rate." in parsed.words


def test_the_same_study_gives_the_same_page(whole: Study) -> None:
    assert page(whole) == page(whole)


@pytest.mark.parametrize(
    "name",
    [
        "<script>alert(1)</script>",
        "</script><script>alert(1)</script>",
        "\" onload='x' \"",
        "{{ 7 }}",
    ],
)
def test_hostile_names_stay_words(name: str) -> None:
    channels = (f"pressure{name}", f"displacement{name}")
    recording = measured(300, channels=channels, name=name, file=f"{name}.csv", notes=name)
    test = measured(200, seed=1, channels=channels, name=name)
    blocks = {"gpi": renamed(GPI.example(), channels), "pi": renamed(PI.example(), channels)}
    html = page(study((recording,), (test,), blocks=blocks, notes=(name,), reason=name))
    parsed = Parsed(html)
    assert len(parsed.scripts) == 4
    assert not any(attribute.startswith("on") for _, attribute, _ in parsed.attributes)
    assert "<script>alert" not in html
    assert parsed.words.count(name) >= 4
    title = parsed.figures["loop"][0][0]["layout"]["xaxis"]["title"]["text"]
    assert title.startswith("pressure")
    assert "<" not in title


def lead(parsed: Parsed) -> str:
    """Return what the first picture is drawn over."""
    return str(parsed.figures["lead"][0][0]["layout"]["xaxis"]["title"]["text"])


def test_the_coupling_picture_names_its_recording() -> None:
    def run(still: bool, name: str) -> Recording:
        one = measured(300, name=name)
        other = one["pressure"][::-1] * (not still)
        values = {channel: one[channel] for channel in one.channels} | {"pressure_2": other}
        return Recording(values, 0.01, meta=one.meta)

    base = study((run(False, "all of them"),), (run(True, "one alone"),))
    inputs = ("pressure", "pressure_2")
    board = replace(base.leaderboard, inputs=inputs)
    base = replace(base, leaderboard=board, characterization=None)
    found = Parsed(page(base))
    assert "(columns), of all of them." in found.words
    assert "pressure moves displacement by" in found.words
    assert lead(found) == "pressure [bar]"
    found = Parsed(page(replace(base, test=base.train)))
    assert lead(found) == "time [s]"  # a path over one of two inputs that move is no loop


def test_the_coupling_is_of_all_recordings_and_not_of_those_pictured_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counted: list[int] = []

    def counting(recordings: Sequence[Recording], *channels: Sequence[str]) -> Coupling:
        counted.append(len(recordings))
        return coupling_subjects.coupling(recordings, *channels)

    train = tuple(
        one.with_channels({"pressure_2": "bar"}, pressure_2=one["pressure"][::-1])
        for one in (measured(200, seed=k, name=f"run {k}") for k in range(8))
    )
    base = study(train[:7], train[7:])
    inputs = ("pressure", "pressure_2")
    seen = SimpleNamespace(**vars(coupling_subjects) | {"coupling": counting})
    monkeypatch.setattr("mckibben.report.page.coupling_subjects", seen)
    page(replace(base, leaderboard=replace(base.leaderboard, inputs=inputs)))
    assert counted == [8]


def test_one_recording_without_time_is_enough() -> None:
    whole = measured(200, sample_time=None)
    blocks = {"gpi": GPI.example()}
    parsed = Parsed(page(study((whole.slice(0, 150),), (whole,), blocks=blocks)))
    assert "no time" in parsed.words
    axis = parsed.figures["fit"][0][0]["layout"]["xaxis"]
    assert axis["title"]["text"] == "sample"
    assert not any(value == "recording" for _, name, value in parsed.attributes if name == "name")


def test_a_study_without_inverse_says_so() -> None:
    parsed = Parsed(page(study(inverse=False)))
    assert "no model that worked can be inverted" in parsed.words
    assert "inverse" not in parsed.figures


def test_a_study_in_which_every_model_failed_is_still_a_report() -> None:
    parsed = Parsed(page(study(blocks={})))
    assert set(SECTIONS) <= set(parsed.ids)
    assert set(parsed.figures) == {"lead", "time", "loop"}
    assert "failed: the data have no time" in parsed.words


def test_six_recordings_are_drawn_and_all_are_named() -> None:
    train = tuple(measured(200, seed=k, name=f"run {k}") for k in range(7))
    parsed = Parsed(page(study(train)))
    assert len(parsed.figures["fit"]) == 6
    assert all(f"run {k}" in parsed.words for k in range(7))
    options = [value for tag, name, value in parsed.attributes if tag == "option"]
    assert sorted(set(options)) == [str(k) for k in range(6)]


@pytest.mark.parametrize("n_recordings", [1, 6])
def test_a_million_samples_stay_under_six_megabytes(tmp_path: Path, n_recordings: int) -> None:
    each = tuple(
        measured(1_000_000 // n_recordings, seed=k, sample_time=1e-3, name=f"run {k}")
        for k in range(n_recordings)
    )
    train = each[:-1] or (each[0].slice(0, 750_000),)
    blocks = models() | {f"model {k}": GPI.example() for k in range(4)}
    write_report(study(train, each[-1:], blocks=blocks), tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_size < 6e6


def test_a_failure_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Study
) -> None:
    path = tmp_path / "report.html"
    path.write_text("before")
    monkeypatch.setattr(Path, "replace", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_report(whole, path)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_page_is_whole_before_any_model_is_fitted(whole: Study) -> None:
    board = replace(whole.leaderboard, rows=(), pending=("pi", "gpi"))
    early = replace(whole, leaderboard=board, predictions={}, inverse=None)
    parsed = Parsed(page(early))
    assert set(SECTIONS) <= set(parsed.ids)
    assert {"time", "loop"} <= set(parsed.figures)
    assert "pi and gpi to come" in parsed.words
    assert "No model worked" not in parsed.words


@needs("chromium")
def test_nothing_is_wider_than_a_phone(tmp_path: Path) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    long = "/".join(["", *(f"{'folder_of_measurements' * 2}{k}" for k in range(3)), "run.csv"])
    noted = measured(source=long).with_meta(notes=[f"column {'a' * 90} is left out"])
    path = tmp_path / "report.html"
    write_report(study((noted,), notes=(f"{long} is shared",)), path)
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(
            executable_path=where("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 400, "height": 800})
        page.goto(path.as_uri())
        width = page.evaluate("document.documentElement.scrollWidth")
        browser.close()
    assert width <= 400

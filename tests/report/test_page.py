"""Pages are whole, need nothing but themselves, and take names from files for text."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mckibben import registry
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.play_type.gpi import GPI
from mckibben.blocks.play_type.pi import PI
from mckibben.outputs import Results
from mckibben.papers.reproduction import Figure, Points, Reproduction, Source, Table
from mckibben.recording import Recording
from mckibben.report import StudyFolder, coupling_subjects, templating, write_report
from mckibben.report.coupling_subjects import Coupling
from mckibben.report.description_subjects import figures
from mckibben.report.page import page
from mckibben.report.reproduction import beside, reproduction_page
from mckibben.studying.study import Study
from mckibben.validation.describing import ModelDescription, describe
from tests.report.studies_by_hand import measured, models, renamed, study
from tests.tools import needs, where

SECTIONS = {
    *("headline", "recordings", "characterization", "leaderboard", "fit", "residuals"),
    *("weights", "inverse", "method"),
}
VOID = {"meta", "link", "input", "br", "img"}
LOADING = {"src", "srcset", "href", "action", "poster", "data", "formaction", "xlink:href"}


class Parsed(HTMLParser):
    """A page: its attributes, its words outside scripts, its scripts; nesting is checked."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.attributes: list[tuple[str, str, str]] = []
        self.scripts: list[str] = []
        self.words = ""
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag == "script":
            self.scripts.append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts[-1] += data
        elif not self.open or self.open[-1] != "style":
            self.words += data

    def all(self, attribute: str) -> list[str]:
        return [value for _, name, value in self.attributes if name == attribute]

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


def test_the_page_has_every_section_once_and_every_plot_its_data_and_label(parsed: Parsed) -> None:
    ids = parsed.all("id")
    assert set(ids) >= SECTIONS
    assert len(ids) == len(set(ids))
    linked = {v[1:] for tag, name, v in parsed.attributes if tag == "a" and name == "href"}
    assert linked <= set(ids)
    assert set(parsed.all("data-figure")) == set(parsed.figures)
    plots = len(parsed.all("data-panel"))
    assert plots == sum(len(variants[0]) for variants in parsed.figures.values())
    assert len(parsed.all("aria-label")) >= plots


def test_nothing_is_loaded_from_elsewhere(parsed: Parsed) -> None:
    for _, name, value in parsed.attributes:
        if name in LOADING:
            assert value.startswith(("#", "data:"))
        assert "url(" not in value
    policy = [v for t, name, v in parsed.attributes if t == "meta" and name == "content"]
    assert any(value.startswith("default-src 'none'") for value in policy)
    style = files("mckibben.report").joinpath("templates/report.css").read_text()
    assert not re.search(r"url\(|@import|https?:", style)
    used = set(re.findall(r'"(--[a-z0-9-]+)"', parsed.scripts[0]))
    assert used
    assert {colour for colour in used if style.count(f"{colour}: #") != 2} == set()  # light, dark


def test_the_same_study_gives_the_same_page(whole: Study) -> None:
    assert page(whole) == page(whole)


@pytest.mark.parametrize(
    "name", ["</script><script>alert(1)</script>", "\" onload='x' \"", "{{ 7 }}"]
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


def test_of_several_inputs_a_loop_leads_only_where_one_moves() -> None:
    def run(still: bool, name: str) -> Recording:
        one = measured(300, name=name)
        return one.with_channels(
            {"pressure_2": "bar"}, pressure_2=one["pressure"][::-1] * (not still)
        )

    base = study((run(False, "all of them"),), (run(True, "one alone"),))
    board = replace(base.leaderboard, inputs=("pressure", "pressure_2"))
    base = replace(base, leaderboard=board, characterization=None)
    html = page(base)
    found = Parsed(html)
    assert "coupling" in found.figures
    coupling = html[html.index('<section id="coupling"') :].partition("</section>")[0]
    assert "all of them" in coupling
    assert "one alone" not in coupling
    assert lead(found) == "pressure [bar]"
    assert lead(Parsed(page(replace(base, test=base.train)))) == "time [s]"


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
    board = replace(base.leaderboard, inputs=("pressure", "pressure_2"))
    seen = SimpleNamespace(**vars(coupling_subjects) | {"coupling": counting})
    monkeypatch.setattr("mckibben.report.page.coupling_subjects", seen)
    found = Parsed(page(replace(base, leaderboard=board)))
    assert counted == [8]
    assert len(found.figures["fit"]) == 6  # are drawn
    assert [k for k in range(8) if f"run {k}" not in found.words] == []
    assert sorted({v for tag, n, v in found.attributes if tag == "option"}) == list("012345")


def test_pages_of_little_are_whole() -> None:
    timeless = measured(200, sample_time=None)
    blocks = {"gpi": GPI.example()}
    parsed = Parsed(page(study((timeless.slice(0, 150),), (timeless,), blocks=blocks)))
    assert parsed.figures["fit"][0][0]["layout"]["xaxis"]["title"]["text"] == "sample"
    assert "recording" not in parsed.all("name")  # nothing to choose from
    assert "inverse" not in Parsed(page(study(inverse=False))).figures
    failed = study(blocks={})
    board = replace(failed.leaderboard, rows=(), pending=("pi", "gpi"))
    for found in (failed, replace(failed, leaderboard=board)):
        parsed = Parsed(page(found))
        assert set(parsed.all("id")) >= SECTIONS
        assert set(parsed.figures) == {"lead", "time", "loop"}


def test_a_million_samples_stay_under_six_megabytes(tmp_path: Path) -> None:
    *train, test = (
        measured(1_000_000 // 6, seed=k, sample_time=1e-3, name=f"run {k}") for k in range(6)
    )
    blocks = models() | {f"model {k}": GPI.example() for k in range(4)}
    write_report(study(tuple(train), (test,), blocks=blocks), tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_size < 6e6


def test_results_are_on_disk_as_they_come_and_a_failure_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Study
) -> None:
    board = whole.leaderboard
    names = tuple(row.model for row in board.rows)
    path = tmp_path / "report.html"
    Results(tmp_path).write_text("inverse.json", "of an earlier study")
    folder = StudyFolder(tmp_path)
    assert not (tmp_path / "inverse.json").exists()
    pages = []
    for done in range(3):
        so_far = replace(board, rows=board.rows[:done], pending=names[done:])
        predictions = whole.predictions if done else {}
        folder.take(replace(whole, leaderboard=so_far, predictions=predictions, inverse=None))
        pages.append(path.read_text())
        assert len(json.loads((tmp_path / "leaderboard.json").read_text())["rows"]) == done
        assert len(list(tmp_path.glob("models/*.json"))) == done
    assert pages[0] != pages[1] == pages[2]  # only the first model's page is not waited for
    folder.take(whole)
    last = path.read_text()
    assert last not in pages
    assert (tmp_path / "inverse.json").exists()
    there = sorted(tmp_path.iterdir())
    monkeypatch.setattr(Path, "replace", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_report(whole, path)
    assert path.read_text() == last
    assert sorted(tmp_path.iterdir()) == there


@pytest.mark.long
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
        shown = browser.new_page(viewport={"width": 400, "height": 800})
        shown.goto(path.as_uri())
        width = shown.evaluate("document.documentElement.scrollWidth")
        browser.close()
    assert width <= 400


# -- the section on a model ----------------------------------------------------------------------


def described(block: Any, **options: Any) -> ModelDescription:
    u = 2.5 - 2.3 * np.cos(2 * np.pi * 5 * np.arange(2000) / 2000)
    u += np.random.default_rng(0).uniform(-0.1, 0.1, u.size)
    y = np.asarray(block.simulate(u, sample_time=0.05))
    y = y + np.random.default_rng(1).normal(0, 0.05, u.size)
    given, wanted = block.inputs[0], block.outputs[0]
    units = {given.name: given.unit, wanted.name: wanted.unit}
    return describe(block, [Recording({given.name: u, wanted.name: y}, 0.05, units)], **options)


def section(found: ModelDescription) -> str:
    template = templating.template("_model.html.j2")
    return template.render(description=found, figures=figures(found))


def test_equations_parameters_and_plots_of_a_model_are_there() -> None:
    found = described(PI((0.0, 0.3, 0.8), (3.0, 1.5, 0.9), 2.0))
    text = section(found)
    assert text.count("<math") > 5
    for one in found.parameters:
        assert f'<th scope="row" class="unit">{one.name}</th>' in text
        assert one.unit in text
    assert 'data-figure="response displacement"' in text


@pytest.mark.parametrize(
    "unit",
    [
        r"<script>alert(1)</script>_\frac{a",
        r"}\href{javascript:alert(1)}{x}\mathrm{",
        '"><img src=x onerror=alert(1)>',
        r"\style{background:url(//x)}{mm}",
    ],
)
def test_units_and_names_from_files_lead_nowhere(unit: str) -> None:
    """Neither links nor events nor styles nor LaTeX: whatever a file calls its channels."""
    given, wanted = Channel(unit, unit), Channel("bend" + unit, unit)
    text = section(described(PI((0.0, 0.3), (3.0, 1.5), 2.0, input=given, output=wanted)))
    shown = Parsed(text)
    assert {"math", "table"} <= shown.tags
    assert not shown.tags & {"img", "script", "a", "iframe", "mfrac", "code"}
    names = {name for _, name, _ in shown.attributes}
    assert not {name for name in names if name.startswith("on")}
    assert not names & {"href", "src", "style", "xlink:href"}


# -- re-runs of papers ---------------------------------------------------------------------------

RAMP = np.linspace(0.0, 1.0, 5)
TABLE = Table(
    "Errors",
    ("model", "RMSE, printed", "RMSE, here", "why"),
    (("play", 2.0, 1.5, ""), ("creep", None, 0.5, ""), ("none", None, None, "failed")),
    drawn=Points("RMSE [mm]", ("RMSE, printed", "RMSE, here", "not there"), bound=3.0),
)


def test_every_number_of_the_drawn_columns_is_a_point_in_its_row() -> None:
    (panel,) = beside(TABLE).panels
    printed, here = panel.curves
    assert panel.categories == ("play", "creep", "none")
    assert (printed.style, printed.x.tolist(), printed.y.tolist()) == ("rings", [2.0], [0.0])
    assert (here.style, here.x.tolist(), here.y.tolist()) == ("dots", [1.5, 0.5], [0.0, 1.0])
    assert [mark.x for mark in panel.marks] == [3.0]


@pytest.mark.parametrize("quick", [True, False])
def test_the_paper_comes_first_then_ours_beside_it_and_raw_signals_last(quick: bool) -> None:
    source = Source("A Muscle", "Does it?", authors="Gaylord", published="1958", doi="10.1/x")
    raw = Figure("Pressure", "time [s]", "pressure [bar]", {"": (RAMP, RAMP)})
    loops = Figure(
        "Loops", "pressure [bar]", "y [mm]", {"virtual": (RAMP, RAMP), "play": (RAMP, RAMP)}
    )
    words = reproduction_page(
        Reproduction("muscle", source, ("It does.",), (TABLE,), (raw, loops), ("Levels.",), quick)
    )
    parts = ["A Muscle", "Gaylord", "10.1/x", "Does it?", "It does."]
    places = [words.index(part, words.index("<header>")) for part in parts]
    places += [words.index(f"<h3>{title}</h3>") for title in ("Errors", "Loops", "Pressure")]
    assert places == sorted(places)
    assert ("reproduce muscle --quick" in words) == quick


@pytest.mark.parametrize("paper", registry.names("papers"))
def test_every_paper_has_its_source(paper: str) -> None:
    source = sys.modules[registry.load("papers", paper).__module__].SOURCE
    html = reproduction_page(Reproduction(paper, source, (), (), (), (), quick=True))
    header = unescape(html[html.index("<header>") : html.index("</header>")])
    for part in (source.title, source.question, source.authors, source.doi):
        assert (part or "") in header

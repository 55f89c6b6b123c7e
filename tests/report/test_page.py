"""Pages are whole, need nothing but themselves, and take names from files for text."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mckibben
from mckibben import example
from mckibben.blocks.fields import Channel
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.blocks.hysteresis.pi import PI
from mckibben.comparison.leaderboard import Row
from mckibben.diagnosis.description import describe
from mckibben.numerals import number, percent
from mckibben.outputs import Results
from mckibben.recording import Recording
from mckibben.report import StudyFolder, write_report
from mckibben.report.builder import Page, Section
from mckibben.report.check_page import check_page
from mckibben.report.commands import commands
from mckibben.report.page import page
from mckibben.report.results import description, tiles
from mckibben.report.words import answers
from mckibben.studying.study import Study
from tests.report.studies_by_hand import measured, plain_study, renamed, study

SECTIONS = {"headline", "leaderboard", "model", "checks", "recordings", "method"}
MOST_WORDS = 800
MATHML = "http://www.w3.org/1998/Math/MathML"
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


def test_nothing_that_pages_are_made_of_leads_elsewhere() -> None:
    rooms = [Path(str(files("mckibben"))) / room for room in ("report", "app")]
    made = [
        f for room in rooms for f in room.rglob("*") if f.suffix in {".py", ".css", ".js", ".j2"}
    ]
    allowed = re.compile(
        r"http://www\.w3\.org/|https://doi\.org/|http://\{"
    )  # names, citations, itself
    found = {
        f.name for f in made if re.search(r"https?://|@import", allowed.sub("", f.read_text()))
    }
    assert len(made) > 40
    assert not found


@pytest.mark.parametrize("blocks", [{"gpi": GPI.example()}, None])
def test_every_model_of_a_figure_that_is_chosen_from_can_be_shown(blocks: Any) -> None:
    parsed = Parsed(page(plain_study() if blocks is None else study(blocks=blocks)))
    chosen = {v for t, n, v in parsed.attributes if t == "input" and n == "value"}
    for name in ("fit", "residuals"):
        drawn = {trace["meta"] for plot in parsed.figures[name][0] for trace in plot["data"]}
        assert drawn - {None} == chosen
    assert sum(name == "checked" for _, name, _ in parsed.attributes) == 1


def test_the_page_of_the_example_is_short_and_has_its_tiles_answers_and_title() -> None:
    found = mckibben.study(
        mckibben.read(example.TRAIN),
        mckibben.read(example.TEST),
        models=("pi", "gpi", "mpi"),
        jobs=1,
    )
    html = page(found, title="A title of its own")
    parsed = Parsed(html)
    assert len(parsed.words.split()) <= MOST_WORDS
    assert "A title of its own" in parsed.words
    assert parsed.all("class").count("tile") == len(tiles(found)) == 4
    assert set(parsed.all("id")) >= SECTIONS
    for question, answer in answers(found):
        assert question in parsed.words
        assert answer.split()[0] in parsed.words
    plain = re.sub(r"(?s)<script.*?</script>", "", html).replace(MATHML, "")
    assert "://" not in plain


def test_a_check_comes_from_the_builder_and_has_no_links() -> None:
    found = plain_study()
    best = found.leaderboard.best
    assert best is not None
    assert best.block is not None
    parsed = Parsed(check_page(mckibben.check(best.block, found.test), "model.json"))
    assert {"headline", "output-0"} <= set(parsed.all("id"))
    assert parsed.all("name").count("generator") == 1
    assert not [v for t, n, v in parsed.attributes if n in LOADING and "//" in v]


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
    title = parsed.figures["lead"][0][0]["layout"]["xaxis"]["title"]["text"]
    assert title.startswith("pressure")
    assert "<" not in title.replace("<i>u</i>", "")


def test_pages_of_little_are_whole() -> None:
    timeless = measured(200, sample_time=None)
    blocks = {"gpi": GPI.example()}
    parsed = Parsed(page(study((timeless.slice(0, 150),), (timeless,), blocks=blocks)))
    assert parsed.figures["fit"][0][0]["layout"]["xaxis"]["title"]["text"] == "sample"
    assert "recording" not in parsed.all("name")  # nothing to choose from
    assert "inverse" not in Parsed(page(study(inverse=False))).figures
    failed = study(blocks={})
    board = replace(failed.leaderboard, rows=(), pending=("pi", "gpi"))
    lost = replace(board, rows=(Row("pi", "it fails"),), pending=("gpi",))
    for found in (failed, *(replace(failed, leaderboard=one) for one in (board, lost))):
        parsed = Parsed(page(found))
        assert set(parsed.all("id")) >= SECTIONS - {"model", "checks"}
        assert set(parsed.figures) == {"lead", "time"}


def test_results_are_on_disk_as_they_come_and_a_failure_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Study
) -> None:
    board = whole.leaderboard
    names = tuple(row.model for row in board.rows)
    results = Results(tmp_path)
    folder, new = StudyFolder(results), results.new
    pages = []
    for done in range(3):
        so_far = replace(board, rows=board.rows[:done], pending=names[done:])
        predictions = whole.predictions if done else {}
        folder.take(replace(whole, leaderboard=so_far, predictions=predictions, inverse=None))
        path = new / "report.html"
        pages.append(path.read_text())
        assert len(json.loads((new / "leaderboard.json").read_text())["rows"]) == done
        assert len(list(new.glob("models/*.json"))) == done
    assert pages[0] != pages[1] == pages[2]  # only the first model's page is not waited for
    folder.take(whole)
    assert not (tmp_path / "report.html").exists()
    results.commit()
    path = tmp_path / "report.html"
    last = path.read_text()
    assert last not in pages
    assert (tmp_path / "inverse.json").exists()
    there = sorted(tmp_path.iterdir())
    monkeypatch.setattr(Path, "replace", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_report(whole, path)
    assert path.read_text() == last
    assert sorted(tmp_path.iterdir()) == there


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
    push, bend = Channel(unit, unit), Channel("bend" + unit, unit)
    model = PI((0.0, 0.3), (3.0, 1.5), 2.0, input=push, output=bend)
    moved = measured(1000)
    u, y = moved["pressure"], model.simulate(moved["pressure"]) + 0.1 * moved["displacement"]
    units = {push.name: unit, bend.name: unit}
    found = describe(model, [Recording({push.name: u, bend.name: y}, 0.05, units)])
    html = Page("", "", [Section("model", "", description(found))]).html()
    shown = Parsed(html[html.index("<section") : html.index("</main>")])
    assert {"math", "table"} <= shown.tags
    assert not shown.tags & {"img", "a", "iframe", "mfrac", "code"}
    names = {name for _, name, _ in shown.attributes}
    assert not {name for name in names if name.startswith("on")}
    assert not names & {"href", "src", "style", "xlink:href"}


@given(st.floats(-1e300, 1e300), st.integers(1, 6))
def test_numbers_keep_their_digits(value: float, digits: int) -> None:
    read = float(number(value, digits).replace("−", "-"))
    assert read == pytest.approx(value, rel=0.5000001 * 10 ** (1 - digits), abs=5e-324)


def test_what_is_not_a_number_is_a_dash_and_shares_are_percentages() -> None:
    assert {number(value) for value in (None, float("nan"), float("inf"))} == {"–"}
    assert (percent(0.5), percent(1.0, 3), percent(None)) == ("50 %", "100 %", "–")


def test_commands_are_quoted_and_name_every_file_once() -> None:
    whole = measured(200, file="my data/run 1.csv")
    other = measured(200, seed=1, file="$(rm).csv", name="other")
    (again, *_) = (line for _, line in commands(study((whole.slice(0, 150),), (whole,))))
    words = shlex.split(again)
    assert words[:3] == ["mckibben", "study", "my data/run 1.csv"]
    assert words.count("my data/run 1.csv") == 1
    (again, *_) = (line for _, line in commands(study((whole,), (other,))))
    words = shlex.split(again)
    assert words[words.index("--test") + 1] == "$(rm).csv"
    assert words[words.index("--models") + 1] == "eupi,gpi,mpi,pi,rdpi"


def test_a_study_is_repeated_as_it_was_typed() -> None:
    typed = "mckibben study 'a b.csv' --column 'pressure=P (1)'"
    assert commands(plain_study(), typed)[0][1] == typed

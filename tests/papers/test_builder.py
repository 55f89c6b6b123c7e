"""The builder of all papers: descriptions that hold together, tables, sentences, pages and dates."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from mckibben import Recording, registry
from mckibben.checkpoints import Checkpoints
from mckibben.errors import DataError, ModelError
from mckibben.papers.experiment import Experiment, Verdict, reproduce
from mckibben.papers.paper import paper, papers
from mckibben.papers.recognising import Labels, Runs
from mckibben.report.reproduction import comparison, drawing, heading, markdown, reproduction_page
from tests.refusals import refused

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "papers"
PAPERS = registry.names("papers")


def experiment(name: str = "field-models", quick: bool = True) -> Experiment:
    return Experiment(
        name,
        None,
        None,
        quick=quick,
        seed=0,
        jobs=1,
        checkpoints=Checkpoints(None),
        progress=lambda share, text: None,
    )


def test_a_model_no_better_than_the_mean_is_told_by_its_errors() -> None:
    noise = np.random.default_rng(3).standard_normal((2, 500))
    unrelated = Recording({"pressure": noise[0], "displacement": np.cumsum(noise[1])}, 0.1)
    fitted = experiment().fit("ARX", "arx", unrelated)
    assert fitted.rmse > np.std(unrelated["displacement"])
    with pytest.raises(DataError):  # where nothing can be fitted, there is nothing to tell
        experiment().fit("ARX", "arx", unrelated.select(["pressure"]))


def test_papers_are_numbered_one_after_another() -> None:
    assert [each.number for each in papers().values()] == [*range(1, len(PAPERS) + 1)]
    with refused(ModelError, names=("'nobody'", "field-models")):
        paper("nobody")


@pytest.mark.parametrize("name", PAPERS)
def test_pages_are_of_full_runs_after_the_last_change_of_what_they_report(name: str) -> None:
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    given = re.search(rf"(\d{{4}}-\d\d-\d\d) by `mckibben reproduce {name}`", text)
    assert given, "not of a run of everything"
    anchors = {
        re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", line.lower()))
        for line in re.findall(r"^#+ (.*)$", text, re.M)
    }
    assert set(re.findall(r"\]\(#([^)]*)\)", text)) <= anchors
    for picture in re.findall(r"!\[.*?\]\((.*?)\)", text):
        assert (PAGES / picture).is_file(), picture
    numbers = f"tests/golden/data/papers/{name}.json"
    room = registry.load("papers", name).__module__.replace(".", "/").rpartition("/")[0]
    changed = subprocess.run(
        ["git", "log", "-1", "--format=%cs", "--", numbers, f"src/{room}/paper.toml"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    ).stdout.strip()
    if not changed:
        pytest.skip("no history of the files")
    assert given[1] >= changed, f"run: python docs/papers/make.py {name}"


def test_printed_figures_stand_before_ours() -> None:
    made = experiment()
    columns = ["RMSE test [mm]", "reason"]
    made.table("errors", columns, {"NARX": [1.0, None], "ours": [0.5, None]}, seeds="0 to 2")
    (table,) = made.tables
    assert table.columns[:3] == ("model", "RMSE test [mm], printed", "RMSE test [mm]")
    assert table.rows[0][:3] == ("NARX", 2.10, 1.0)
    assert table.rows[1][:3] == ("ours", None, 0.5)
    assert "reason" not in table.columns  # nothing to say in it
    assert "0 to 2" in table.text.note
    (panel,) = comparison(table).panels
    assert [curve.style for curve in panel.curves] == ["rings", "dots"]
    assert heading(table, quick=True) != heading(table)


def test_printed_figures_in_units_are_of_rigs_of_the_papers_size() -> None:
    made = experiment("sdchm")
    made.of_its_size = False
    made.table("gains", ["gain"], {"G21": [0.2]}, printed=0.4, here=0.5)
    errors = ["Err [%], SDCHM, as published", "RMSE [mm], SDCHM, as published"]
    made.table("groups", errors, {"(a) p1, y1": [2.0, 1.0]}, p0=0.1)
    gains, groups = made.tables
    assert gains.columns == ("of", "gain, printed", "gain")
    assert f"{errors[0]}, printed" in groups.columns
    assert f"{errors[1]}, printed" not in groups.columns
    profile = experiment("activation-pressure")
    profile.of_its_size = False
    profile.table("points", ["e_1"], {"0 N, printed": [0.1], "0 N, here": [0.2]})
    profile.add_facts(slope=0.2, slope_printed=0.267)
    x = np.linspace(0.0, 1.0, 9)
    profile.figure("rates", {"gamma": {"printed": (x, x), "here": (x, x)}})
    assert profile.tables[0].rows == (("0 N, here", 0.2),)
    assert [*profile.figures[0].panels["gamma"].curves] == ["here"]
    assert not profile.done("a rig").summary


def test_recordings_that_are_there_are_no_part_of_the_work() -> None:
    shares: list[float] = []
    time = np.arange(0.0, 60.0, 0.02)
    runs = [
        Recording({"pressure": u, "displacement": 5 * u}, 0.02, meta={"name": name})
        for name in ("a", "b")
        for u in [3.0 + np.sin(time)]
    ]
    made = experiment()
    made.data, made.progress = runs, lambda share, text: shares.append(share)
    made.record(until=0.8)
    for share in (0.8, 0.9, 1.0):
        made.report(share, "")
    assert shares == pytest.approx([0.0, 0.5, 1.0])


def test_a_sentence_without_its_facts_is_left_out_and_models_that_warn_are_named() -> None:
    made = experiment()
    made.add_facts(best="NARX", n_seeds=3, best_seeds=3, best_plain=1.5, best_matched=1.6)
    found = made.done("a rig")
    assert len(found.summary) == 1
    assert "1.50 mm" in found.summary[0]
    assert found.paper.quick in found.notes
    loaded = experiment("mpi-narmax")
    gains = {"status_4_gains": [2.7, 3.0], "status_4_gains_rmse": [1.5, 2.5]}
    for better, text in ((True, "As in"), (False, "Unlike")):
        loaded.add_facts(**gains, status_4_better=Verdict(better))
        (sentence,) = loaded.done("a rig").summary
        assert sentence.startswith(text)
        assert "2.7" in sentence


def test_pages_name_the_paper_and_its_figures() -> None:
    made = experiment()
    x = np.linspace(0.0, 1.0, 100)
    made.figure("signals", {"calibration": {"": (x, x)}, "test": {"": (x, x), "ours": (x, x)}})
    made.add_facts(best="NARX", n_seeds=3, best_seeds=3, best_plain=1.5, best_matched=1.6)
    found = made.done("rig mas20-hanging")
    (figure,) = found.figures
    assert [panel.title for panel in drawing(figure).panels] == ["calibration", "test"]
    text = markdown(found, "2026-01-01", "pictures")
    assert f"2026-01-01 by `mckibben reproduce {found.name} --quick`" in text
    assert "![Pressure](pictures/signals.png)" in text
    assert f"### {heading(figure, quick=True)}" in text.splitlines()
    html = reproduction_page(found)
    for part in (found.paper.title, found.paper.question, found.paper.authors):
        assert part in html
    ids = re.findall(r'<[^<>]* id="([^"]*)"', html)
    assert len(ids) == len(set(ids))  # scripts find their data by them


def test_recordings_need_the_channels_and_the_runs_of_the_paper() -> None:
    time = np.arange(0.0, 60.0, 0.02)
    runs = [
        Recording({"pressure": u, "displacement": 5 * u}, 0.02, meta={"name": name})
        for name in ("a", "b")
        for u in [3.0 + np.sin(time)]
    ]
    made = experiment()
    made.data = runs
    assert made.record().names("train") == ["a"]
    assert [table.key for table in made.tables] == ["recognised"]
    with refused(DataError, names="irregular"):
        reproduce("field-models", data=runs[:1])
    with refused(DataError, channel="displacement"):
        reproduce("field-models", data=[one.select(["pressure"]) for one in runs])
    with refused(DataError, parameter="recordings"):
        reproduce("field-models", data=[])


def test_runs_are_chosen_by_role_and_label() -> None:
    one = Recording({"pressure": np.array([0.0, 1.0])}, 0.1)
    runs = Runs({"a": one, "b": one}, {"a": Labels("train", {"p0": 1.0}), "b": Labels("test", {})})
    assert runs.names("train") == runs.names(p0=1.0) == ["a"]
    assert runs.of("a", "p0") == 1.0
    assert len(runs.select()) == 2

"""What a page chooses from the recordings and results that are there: sides, models, what hinders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import Recording
from mckibben.app import adding, plots
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.kept import Reading, Step
from mckibben.app.loads import Load, load_in, loads_in
from mckibben.app.offering import offered, sides
from mckibben.app.pages import apart, data, judging
from mckibben.app.pages.cutting import first_shown
from mckibben.app.pages.loads import untold
from mckibben.app.theme import DARK, LIGHT, WRITTEN, contrast
from mckibben.app.together import differing, obstacle, sample_times
from mckibben.app.workspace import Workspace
from mckibben.report import subjects
from tests.app.simulated import desk_of, filled, swung, workspace_of
from tests.report.studies_by_hand import hung, two_muscles


def models_of(desk: Desk) -> set[str]:
    return {offer.model for _, offers in offered(desk).groups for offer in offers}


# -- sides ---------------------------------------------------------------------------------------


def test_a_channel_is_on_one_side(tmp_path: Path) -> None:
    desk = desk_of(filled(tmp_path))
    assert (desk.inputs, desk.outputs) == (("pressure",), ("displacement",))
    desk.choose("outputs", ["pressure"])
    assert (desk.inputs, desk.outputs) == (("displacement",), ("pressure",))
    desk.choose("inputs", ["displacement", "pressure"])
    assert (desk.inputs, desk.outputs) == (("displacement",), ("pressure",))


def test_a_dead_load_is_given_beside_and_never_an_input(tmp_path: Path) -> None:
    workspace = workspace_of(tmp_path, hung10=hung(10.0), hung20=hung(20.0))
    desk = desk_of(workspace)
    asked_for = {"input": "pressure", "output": "displacement", "load": "force"}
    for inputs in (["pressure"], ["pressure", "force"]):
        desk.choose("inputs", inputs)
        assert desk.channels == asked_for
        assert desk.looked_at() == (("pressure", "displacement"),)
    assert {"balance"} <= models_of(desk)
    assert "pi" not in models_of(desk)
    desk.choose("inputs", ["force"])
    assert desk.channels == {"input": "force", "output": "displacement"}
    desk.choose("inputs", ["pressure"])
    workspace.set_role(["hung20"], "test")  # what a load does cannot be learned from one
    assert desk.channels == {"input": "pressure", "output": "displacement"}


def test_a_force_that_varies_is_given_where_it_is_chosen(tmp_path: Path) -> None:
    run = swung(10.0)
    desk = desk_of(workspace_of(tmp_path, run=run.with_channels(force=10.0 + np.sin(run.time))))
    assert desk.channels == {"input": "pressure", "output": "displacement"}
    desk.choose("inputs", ["pressure", "force"])
    assert desk.channels["load"] == "force"


def test_at_a_held_length_force_is_the_output_and_pressure_stands_beside(tmp_path: Path) -> None:
    pressure = swung(10.0)["pressure"]
    held = {"pressure": pressure, "displacement": np.full(600, 10.0), "force": 100 * pressure}
    desk = desk_of(workspace_of(tmp_path, held=Recording(held, 0.1)))
    assert desk.channels["output"] == "force"
    assert sides(desk).endswith("pressure")


def test_models_are_offered_by_need_with_reasons_for_the_others(tmp_path: Path) -> None:
    desk = desk_of(filled(tmp_path / "one"))
    found = offered(desk)
    assert {"pi", "gpi", "cpi", "balance"} <= set(found.start) <= models_of(desk)
    assert len(models_of(desk)) + len(found.against) == 50
    assert all(found.against.values())
    several = desk_of(workspace_of(tmp_path / "two", run=two_muscles(5.0)))
    assert several.inputs == ("pressure_1", "pressure_2")
    assert several.channels["output"] == ["displacement_1", "displacement_2"]
    assert {"balance", "coupled-memory"} <= models_of(several)
    assert not {"pi", "gpi", "arx", "coupled-pi"} & models_of(several)
    alone = Recording({"pressure": np.sin(np.arange(200))}, 0.1)
    workspace = workspace_of(tmp_path / "alone", run=alone)
    both = Desk(workspace, Jobs(workspace), inputs=("pressure",), outputs=("pressure",))
    assert models_of(both) == set()


def test_where_a_force_drives_what_is_made_for_it_is_offered_first(tmp_path: Path) -> None:
    run = swung(10.0)
    driven = {"force": run["pressure"], "displacement": run["displacement"]}
    desk = desk_of(workspace_of(tmp_path, driven=Recording(driven, 0.1)))
    desk.choose("inputs", ["force"])
    assert "bouc-wen-oscillator" in offered(desk).start


def test_counts_are_not_drawn_unasked(tmp_path: Path) -> None:
    run = swung(10.0)
    counted = {"level": np.arange(600, dtype=np.float64), "force": run["pressure"], **run.channels}
    recording = Recording(counted, 0.1, units={"level": "", "force": "N"})
    desk = Desk(Workspace(tmp_path), Jobs(Workspace(tmp_path)))
    assert first_shown(desk, recording) == ["pressure", "displacement", "force"]
    assert first_shown(desk, recording.select(["level", "force"])) == ["level", "force"]


# -- results -------------------------------------------------------------------------------------


def test_results_are_of_the_channels_chosen_and_stale_ones_are_not_kept_chosen(
    tmp_path: Path,
) -> None:
    workspace = filled(tmp_path)
    figures = {"rmse": 0.5}
    for name, output in (("mine", "displacement"), ("other", "force")):
        result = {"status": "ok", "model": "pi", "input": "pressure", "output": output}
        workspace.write_json("results", name, result | {"test": figures, "train": figures})
    desk = Desk(workspace, Jobs(workspace))
    assert [result["name"] for result in desk.results()] == ["mine"]
    desk.outputs = ("force",)
    assert [result["name"] for result in desk.results()] == ["other"]
    seen = {"old": "another", "new": workspace.data(), "older": "another"}
    for name, of in seen.items():
        workspace.write_json("results", name, {"status": "ok", "model": "pi", "data": of})
    assert desk.model_to_show("old", ["new", "old"]) == "new"
    assert desk.model_to_show("own", ["new", "own"]) == "own"  # of which nothing is known
    assert desk.model_to_show("gone", ["new", "old"]) == "new"
    assert desk.model_to_show("old", ["older", "old"]) == "old"


def test_a_model_that_fails_on_the_test_alone_is_named() -> None:
    def result(name: str, validated: float | None, tested: float) -> dict[str, Any]:
        return {
            "name": name,
            "current": True,
            "chosen_by": "cross-validation",
            "shared": [],
            "split": "last 80 samples of run to test, all before to fit",
            "test": {"rmse": tested},
            "validation_rmse": validated,
            "validation_failed": "" if validated else "too few cycles",
            "constant": {"test": {"rmse": 38.0}, "validation_rmse": 38.0},
            "skill_least": 0.9,
            "not_recommended": None,
        }

    good, unlike, poor = (
        result("good", 1.0, 2.0),
        result("unlike", 1.2, 36.0),
        result("poor", 35.0, 36.0),
    )
    alone = judging.judged([good])
    told = [text for text in judging.judged([good, unlike, poor]) if text not in alone]
    assert [text.partition(":")[0] for text in told] == ["unlike"]
    unvalidated = [result("unlike", None, 36.0)]
    assert not [text for text in judging.judged(unvalidated) if text.startswith("unlike:")]
    assert "too few cycles" in judging.unvalidated(unvalidated)
    assert judging.unvalidated([good]) == ""


# -- recordings that do not go together ----------------------------------------------------------


def test_sample_times_are_brought_to_one_as_one_change(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for name, step in (("slow", 0.0169), ("fast", 0.0168)):
        time = np.arange(400) * step
        channels = {"pressure": 2 + np.sin(time), "displacement": np.cos(time)}
        workspace.add(Recording(channels, step), origin="a test", call="", name=name)
    desk = desk_of(workspace)
    times = sample_times(desk)
    assert times == pytest.approx((0.0168, 0.0169))
    assert times is not None
    assert obstacle(desk)
    assert models_of(desk) == set()
    wanted = apart.common(times)
    workspace.edit_each(["fast"], "all resampled", Step(do="resample", sample_time=wanted))
    assert workspace.recording("fast").sample_time == wanted
    assert sample_times(desk) is None
    assert obstacle(desk) == ""
    assert workspace.undo() == "all resampled"
    assert sample_times(desk) == times


def test_what_keeps_models_from_being_fitted_is_named(tmp_path: Path) -> None:
    time = np.arange(400) * 0.05
    channels = {"pressure": 2 + np.sin(time), "x": np.cos(time), "angle": np.sin(time)}
    units = {"pressure": "bar", "x": "mm", "angle": "rad"}
    desk = Desk(workspace := workspace_of(tmp_path), Jobs(workspace))
    assert obstacle(desk) == ""
    workspace.add(Recording(channels, 0.05, units=units), origin="", call="", name="one")
    assert "displacement" in obstacle(desk)
    desk.outputs = ("x", "angle")
    assert all(unit in obstacle(desk) for unit in ("mm", "rad"))
    desk.outputs = ("x",)
    assert obstacle(desk) == ""
    assert models_of(desk)


def test_counts_keep_nobody_from_fitting_and_lacking_times_do(tmp_path: Path) -> None:
    run = swung(10.0)
    more: dict[str, tuple[dict[str, str], float | None]] = {
        "level": ({"level": ""}, 0.1),
        "cycle": ({"cycle": ""}, 0.1),
        "pull": ({"force": "N"}, 0.1),
        "late": ({}, None),
    }
    runs = {
        name: Recording(
            dict(run.channels) | dict.fromkeys(units, run["pressure"]), step, {**run.units, **units}
        )
        for name, (units, step) in more.items()
    }
    desk = desk_of(workspace := workspace_of(tmp_path, **runs))
    workspace.set_role(["pull", "late"], "unused")
    assert not differing(desk)
    assert obstacle(desk) == ""
    workspace.set_role("pull", "train")
    assert len(differing(desk)) == 3
    workspace.set_role("pull", "unused")
    workspace.set_role("late", "train")
    assert "late" in obstacle(desk)


# -- loads in names ------------------------------------------------------------------------------


@given(st.from_regex(r"(run)?_?(load|mass|weight)[0-9.]{0,9}(g|kg|N|mm|.)?(_2)?", fullmatch=True))
def test_whatever_the_name_there_is_no_load_or_a_force(name: str) -> None:
    load = load_in(name)
    assert load is None or 0 < load.force < np.inf


@pytest.mark.parametrize(
    ("name", "force"),
    [
        ("sample2_load200g", 1.96133),
        ("Load_10.04kg_run3", 98.458766),
        ("150N-load", 150.0),
        ("mass 0.5 kg", 4.903325),
        *((name, None) for name in ("run_200g", "load200", "load0g", "load20mm", "load2Nm")),
        *((name, None) for name in ("load2N_load3N", "unload")),
    ],
)
def test_loads_are_read_in_newtons(name: str, force: float | None) -> None:
    load = load_in(name)
    assert (None if load is None else load.force) == pytest.approx(force)


def test_loads_are_offered_where_no_force_was_recorded(tmp_path: Path) -> None:
    assert loads_in(["a_200g", "a_400g", "b_300g"]) == {
        "a_200g": Load(200.0, "g"),
        "a_400g": Load(400.0, "g"),
    }
    desk = Desk(workspace := Workspace(tmp_path), Jobs(workspace))
    for name in ("one_load200g", "two_load400g"):
        rows = (f"{k / 10},{1 + k % 9},{k % 7}" for k in range(90))
        content = "\n".join(["time_s,pressure_bar,displacement_mm", *rows]).encode()
        path = workspace.keep_upload(f"{name}.csv", content)
        adding.add(desk, path.name, f"{name}.csv", Reading())
    assert len(untold(workspace)) == 2
    run = swung(7.0)
    measured = run.with_channels({"force": "N"}, force=run["displacement"])
    workspace.add(measured, origin="", call="", name="measured")
    assert not untold(workspace)


# -- small things --------------------------------------------------------------------------------


def test_the_kinds_of_files_are_those_that_are_read_here(monkeypatch: pytest.MonkeyPatch) -> None:
    assert any(".xlsx" in kind for kind in data.taken())
    monkeypatch.setattr(data, "find_spec", lambda name: None if name == "openpyxl" else object())
    assert data.taken() == ["CSV", "TSV", *(kind for kind in data.KINDS if "Excel" not in kind)]


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_the_colours_of_a_theme_can_be_read(theme: dict[str, str]) -> None:
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)  # as WCAG reckons
    low = {(text, ground): contrast(theme[text], theme[ground]) for text, ground in WRITTEN}
    assert {pair: value for pair, value in low.items() if value < 4.5} == {}


def test_pictures_have_plain_numbers_and_colours_and_are_thinned_by_their_window() -> None:
    recording = swung(10.0)
    (plain,) = plots.figures(subjects.loop([recording], "pressure", "displacement"))
    for dark in (False, True):
        figure = plots.coloured(plain, dark)
        trace = figure["data"][0]
        assert isinstance(trace["x"], list)
        assert trace["line"]["color"].startswith("#")
        assert "--" not in str(figure["layout"])
    (whole,) = plots.window(recording, ["pressure"], -1e9, 1e9)
    (part,) = plots.window(recording, ["pressure"], 10.0, 20.0)
    (beyond,) = plots.window(recording, ["pressure"], 1e6, 1e7)
    assert len(whole["x"]) == len(recording)
    assert 9.8 <= part["x"][0] <= 10.0
    assert 20.0 <= part["x"][-1] <= 20.2
    assert len(beyond["x"]) >= 2


def test_a_band_is_shaded_behind_the_curves() -> None:
    t = np.arange(3, dtype=np.float64)
    figure = plots.lines([("model", t, t, "series-1")], x="time [s]", y="y", logarithmic=True)
    assert figure["layout"]["yaxis"]["type"] == "log"
    plots.shaded(figure, t, (t - 1, t + 1), "series-1", "band of model")
    band, model = figure["data"]
    assert (band["name"], band["fill"], model["name"]) == ("band of model", "toself", "model")
    assert band["x"] == [0, 1, 2, 2, 1, 0]
    assert band["y"] == [-1, 0, 1, 3, 2, 1]

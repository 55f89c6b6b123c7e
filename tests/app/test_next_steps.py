"""After a fit: a model is judged, and a motion is planned, as files to take away."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mckibben import Recording, read
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs, by_name
from mckibben.app.offering import offered, sides
from mckibben.app.pages.cutting import first_shown
from mckibben.app.work import check, fit, plan
from mckibben.app.workspace import Workspace
from tests.app.test_jobs import filled, swung
from tests.app.test_jobs import fit as asked
from tests.comparison.test_several import hung


def silent(share: float, cost: float) -> None:
    assert 0 <= share <= 1


def test_a_model_is_judged_on_a_page(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    fit(workspace, asked("pi", "mine"), silent)
    said = check(workspace, {"name": "mine", "file": "mine-check.html"}, silent)
    assert said.startswith("On training recordings, which it was fitted to: ")
    workspace.add(swung(7.0).slice(0, 30), origin="", call="", name="short", role="test")
    said = check(workspace, {"name": "mine", "file": "again.html"}, silent)
    assert said.startswith("Test recordings tell too little: ")
    assert "On training recordings, which it was fitted to: " in said
    assert by_name(workspace, said).startswith("Test recordings tell too little: short: ")
    page = workspace.path("takeaway", "mine-check.html").read_text("utf-8")
    assert "models/mine.json" in page


def test_what_to_record_next_is_a_file(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    said = plan(workspace, {"name": "", "minutes": 0.4, "file": "next.csv", "seed": 0}, silent)
    (found,) = read(workspace.path("takeaway", "next.csv"))
    assert "pressure" in found
    assert said


def test_models_are_offered_by_need_with_reasons_for_the_others(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    desk = Desk(workspace, Jobs(workspace))
    desk.settle_channels()
    found = offered(desk)
    models = {offer.model for _, offers in found.groups for offer in offers}
    assert {"pi", "gpi", "cpi", "balance"} <= set(found.start) <= models
    assert found.recognised.startswith("1 input (pressure); 1 output (displacement)")
    assert len(models) + len(found.against) == 50
    assert all(found.against.values())


def test_what_is_given_beside_a_force_is_told_where_sides_are_chosen(tmp_path: Path) -> None:
    pressure = swung(10.0)["pressure"]
    held = {"pressure": pressure, "displacement": np.full(600, 10.0), "force": 100 * pressure}
    workspace = Workspace(tmp_path)
    workspace.add(Recording(held, 0.1), origin="", call="", name="held")
    desk = Desk(workspace, Jobs(workspace))
    desk.settle_channels()
    assert sides(desk) == "1 input (displacement); 1 output (force); given beside: pressure"


def test_a_dead_load_is_given_beside_and_never_an_input(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for load in (10.0, 20.0):
        workspace.add(hung(load), origin="", call="", name=f"hung{load:g}")
    desk = Desk(workspace, Jobs(workspace))
    desk.settle_channels()
    said = (
        "1 input (pressure); 1 output (displacement); given beside: force, a load, never commanded"
    )
    asked_for = {"input": "pressure", "output": "displacement", "load": "force"}
    for inputs in (["pressure"], ["pressure", "force"]):
        desk.choose("inputs", inputs)
        assert (sides(desk), desk.channels) == (said, asked_for)
        assert desk.looked_at() == (("pressure", "displacement"),)
    models = {offer.model for _, offers in offered(desk).groups for offer in offers}
    assert "balance" in models
    assert "pi" not in models
    desk.choose("inputs", ["force"])
    assert desk.channels == {"input": "force", "output": "displacement"}
    desk.choose("inputs", ["pressure"])
    workspace.set_role(["hung20"], "test")  # what a load does cannot be learned from one
    assert desk.channels == {"input": "pressure", "output": "displacement"}


def test_a_force_that_varies_is_given_where_it_is_chosen(tmp_path: Path) -> None:
    run = swung(10.0)
    pulled = run.with_channels(force=10.0 + np.sin(run.time))
    workspace = Workspace(tmp_path)
    workspace.add(pulled, origin="", call="", name="pulled")
    desk = Desk(workspace, Jobs(workspace))
    desk.settle_channels()
    assert desk.channels == {"input": "pressure", "output": "displacement"}
    assert sides(desk).endswith("given to models that take a load: force")
    desk.choose("inputs", ["pressure", "force"])
    assert desk.channels["load"] == "force"


def test_where_a_force_drives_what_is_made_for_it_is_offered_first(tmp_path: Path) -> None:
    run = swung(10.0)
    driven = {"force": run["pressure"], "displacement": run["displacement"]}
    workspace = Workspace(tmp_path)
    workspace.add(Recording(driven, 0.1), origin="", call="", name="driven")
    desk = Desk(workspace, Jobs(workspace))
    desk.choose("inputs", ["force"])
    assert "bouc-wen-oscillator" in offered(desk).start


def test_counts_are_not_drawn_unasked(tmp_path: Path) -> None:
    run = swung(10.0)
    counted = {"level": np.arange(600, dtype=np.float64), "force": run["pressure"], **run.channels}
    recording = Recording(counted, 0.1, units={"level": "", "force": "N"})
    desk = Desk(Workspace(tmp_path), Jobs(Workspace(tmp_path)))
    assert first_shown(desk, recording) == ["pressure", "displacement", "force"]
    assert first_shown(desk, recording.select(["level", "force"])) == ["level", "force"]

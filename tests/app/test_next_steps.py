"""After a fit: a model is judged, and a motion is planned, as files to take away."""

from __future__ import annotations

from pathlib import Path

from mckibben import read
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs, by_name
from mckibben.app.offering import offered
from mckibben.app.work import check, fit, plan
from tests.app.test_jobs import filled, swung
from tests.app.test_jobs import fit as asked


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

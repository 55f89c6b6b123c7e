"""Loads in the names of files are found, and told to models in one step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nicegui.testing import User

from mckibben.app import adding
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.kept import Reading
from mckibben.app.loads import Load, load_in, loads_in
from mckibben.app.pages.loads import untold
from mckibben.app.workspace import Workspace
from tests.app.test_jobs import swung
from tests.app.test_pages import visit


@given(
    st.one_of(
        st.text(),
        st.from_regex(r"(run)?_?(load|mass|weight)[0-9.]{0,9}(g|kg|N|mm)(_2)?", fullmatch=True),
    )
)
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
    ],
)
def test_loads_are_read_in_newtons(name: str, force: float) -> None:
    load = load_in(name)
    assert load is not None
    assert load.force == pytest.approx(force)


@pytest.mark.parametrize(
    "name", ["run_200g", "load200", "load0g", "load20mm", "load2Nm", "load2N_load3N", "unload"]
)
def test_what_is_no_load_is_not_taken_for_one(name: str) -> None:
    assert load_in(name) is None


def test_a_bare_number_is_a_load_where_names_differ_in_it_alone() -> None:
    assert loads_in(["a_200g", "a_400g", "b_300g"]) == {
        "a_200g": Load(200.0, "g"),
        "a_400g": Load(400.0, "g"),
    }


def dropped(folder: Path, *names: str) -> Workspace:
    """Return a workspace with files that were dropped into it, without a force."""
    workspace = Workspace(folder)
    desk = Desk(workspace, Jobs(workspace))
    for name in names:
        rows = (f"{k / 10},{1 + k % 9},{k % 7}" for k in range(90))
        content = "\n".join(["time_s,pressure_bar,displacement_mm", *rows]).encode()
        path = workspace.keep_upload(f"{name}.csv", content)
        adding.add(desk, path.name, f"{name}.csv", Reading())
    desk.jobs.close()
    return workspace


def test_all_are_told_their_loads_by_one_click(tmp_path: Path) -> None:
    workspace = dropped(tmp_path, "one_load200g", "two_load400g")

    async def look(user: User) -> None:
        await user.should_see("one_load200g 1.96 N, two_load400g 3.92 N", retries=100)
        user.find(marker="take-loads").click()
        await user.should_not_see(marker="loads", retries=100)

    visit(workspace, look)
    assert workspace.recording("two_load400g")["force"] == pytest.approx(3.92266)
    assert "constants={'force': (200.0, 'g')}" in workspace.entry("one_load200g").call
    workspace.undo()
    assert not any("force" in run for run in workspace.readable())


def test_nothing_is_offered_where_a_force_was_recorded(tmp_path: Path) -> None:
    workspace = dropped(tmp_path, "one_load200g", "two_load400g")
    assert len(untold(workspace)) == 2
    run = swung(7.0)
    measured = run.with_channels({"force": "N"}, force=run["displacement"])
    workspace.add(measured, origin="", call="", name="measured")
    assert not untold(workspace)


def test_a_constant_is_taken_out_by_its_button(tmp_path: Path) -> None:
    workspace = dropped(tmp_path, "run")

    async def look(user: User) -> None:
        user.find("How it was read").click()
        await user.should_see(marker="add-constant", retries=100)
        user.find(marker="add-constant").click()
        await user.should_see(marker="constant-value-0")
        user.find(marker="constant-remove-0").click()
        await user.should_not_see(marker="constant-value-0")

    visit(workspace, look)

"""What a person does while something is awaited counts, and not what was before."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui.testing import User

from mckibben import PI, Recording, write
from mckibben.app import forms, recorded, shell
from mckibben.app.adding import Problem
from mckibben.app.desk import Desk
from mckibben.app.jobs import Job, Jobs
from mckibben.app.kept import Step
from mckibben.app.pages import drawing_reference, editing, forces, importing, taking_code
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError
from tests.app.test_compensate import (
    WEAKER,
    field,
    later,
    only,
    until,
    workspace_with,
)
from tests.app.test_pages import visit


class Held:
    """A function that waits where it is called in a thread, until it is let go."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.begun, self.go = threading.Event(), threading.Event()

    def __call__(self, *given: Any, **named: Any) -> Any:
        self.begun.set()
        assert self.go.wait(30.0)
        return self.function(*given, **named)


@contextmanager
def held(monkeypatch: pytest.MonkeyPatch, module: Any, name: str) -> Iterator[Held]:
    one = Held(getattr(module, name))
    monkeypatch.setattr(module, name, one)
    try:
        yield one
    finally:
        one.go.set()


def wave() -> Recording:
    up = 2.0 - 2.0 * np.cos(np.arange(200) * 0.1)
    return Recording({"pressure": up, "displacement": 4.0 * up}, 0.1)


def test_what_is_taken_is_what_was_chosen_at_the_click(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = workspace_with(tmp_path, a=PI.example(), b=WEAKER)

    async def look(user: User) -> None:
        user.find(marker="tab-take").click()
        await until(user, "take-json")
        await asyncio.sleep(0.5)
        only(user, "take-form").set_value("model")
        with held(monkeypatch, forms, "made") as made:
            user.find(marker="take-json").click()
            await later(made.begun.is_set)
            only(user, "take-model").set_value("b")
            made.go.set()
            taken = (await user.download.next(timeout=20.0)).text
        assert workspace.path("takeaway", "a.json").read_text("utf-8") == taken
        assert taken == workspace.path("models", "a.json").read_text("utf-8")
        assert "a.json" in workspace.logged()[-1]["call"]

    visit(workspace, look)


def test_steps_typed_while_uses_are_looked_for_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    workspace.add(wave(), origin="", call="", role="train")

    async def look(user: User) -> None:
        with held(monkeypatch, taking_code, "pace") as pace:
            user.find(marker="tab-take").click()
            await until(user, "take-form")
            await later(pace.begun.is_set)
            field(user, "Time between steps [s]").set_value(0.007)
            pace.go.set()
            await later(lambda: "inverse" in only(user, "take-form").options)
            assert field(user, "Time between steps [s]").value == 0.007

    assert recorded.pace(workspace, "a").step == 0.1
    visit(workspace, look)


@pytest.mark.parametrize("clicked", [True, False])
def test_a_file_does_not_overwrite_a_motion_that_was_clicked_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clicked: bool
) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    path = tmp_path / "wished.csv"
    write(wave().select(["displacement"]), path)

    async def sent(*_: Any) -> Path:
        return path

    monkeypatch.setattr(drawing_reference, "kept", sent)

    async def look(user: User) -> None:
        sketches: list[drawing_reference.Sketch] = []
        ready = drawing_reference.Sketch.ready

        def noted(self: drawing_reference.Sketch, kind: str) -> None:
            sketches.append(self)
            ready(self, kind)

        monkeypatch.setattr(drawing_reference.Sketch, "ready", noted)
        user.find(marker="tab-compensate").click()
        await until(user, "wave")
        user.find(marker="wave").click()
        (sketch,) = sketches
        with held(monkeypatch, drawing_reference, "read_upload") as reading:
            load = asyncio.create_task(sketch._loaded(cast(Any, SimpleNamespace(file=None))))
            await later(reading.begun.is_set)
            if clicked:
                user.find(marker="wave-triangle").click()
            reading.go.set()
            if clicked:
                with pytest.raises(DataError, match="Remedy: drop it again"):
                    await load
            else:
                await load
        assert (sketch.file is None) == clicked

    visit(workspace, look)


def test_the_later_of_two_looks_counts_whichever_ends_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    go, asked = threading.Event(), list[int]()

    def tells(desk: Desk) -> dict[str, list[str]]:
        asked.append(len(asked))
        if len(asked) == 1:
            assert go.wait(30.0)
            return {"older": ["pressure"]}
        return {"newer": ["pressure"]}

    monkeypatch.setattr(forces, "_tells", tells)
    desks: list[Desk] = []
    build = forces.build

    def noted(desk: Desk) -> None:
        desks.append(desk)
        build(desk)

    monkeypatch.setattr(forces, "build", noted)

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await later(lambda: len(asked) == 1)
        desks[0].changed("results")
        await later(lambda: only(user, "force-model").options == ["newer"])
        go.set()
        await asyncio.sleep(0.5)
        assert only(user, "force-model").options == ["newer"]

    try:
        visit(workspace, look)
    finally:
        go.set()


def test_files_that_come_while_others_are_told_of_are_still_coming(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace(tmp_path)
    intake = importing.Intake(Desk(workspace, Jobs(workspace)), None)
    intake.place, intake.reading = nullcontext(), SimpleNamespace(set_text=lambda text: None)
    intake.seen, intake.read = 3, {"one.csv": []}
    told: list[int] = []

    def warm() -> None:
        intake.seen += 2  # others

    monkeypatch.setattr(intake.desk.workspace, "warm", warm)
    monkeypatch.setattr(importing, "tell_of", lambda read: told.append(intake.seen))
    asyncio.run(intake._sum_up())
    assert (told, intake.seen) == ([2], 2)
    intake.problems = [Problem("two.csv", DataError("it is not known", remedy="say it"))]
    monkeypatch.setattr(importing, "tell", lambda text: None)
    asyncio.run(intake._sum_up())
    assert intake.seen == 0


def test_files_that_were_not_read_while_one_was_asked_about_are_not_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace(tmp_path)
    intake = importing.Intake(Desk(workspace, Jobs(workspace)), None)
    error = DataError("it is not known", remedy="say it")
    one, rest, new = (Problem(f"{n}.csv", error, f"{n}.csv") for n in ("one", "rest", "new"))
    intake.left = [one, rest]
    monkeypatch.setattr(intake, "list", lambda: None)

    async def ask(*_: Any, then: Any, **__: Any) -> None:
        intake.left = [*intake.left, new]
        await then([rest])  # one was read

    monkeypatch.setattr(importing, "ask", ask)
    asyncio.run(intake._ask(one))
    assert intake.left == [rest, new]


def test_a_part_of_what_is_not_there_any_more_is_not_cut(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.add(wave(), origin="", call="", name="run")
    desk = Desk(workspace, Jobs(workspace))
    first = Step(do="slice", start=100, stop=200)

    async def cut() -> None:
        await editing.do(desk, "run", first, seen=())
        with pytest.raises(DataError, match="was changed or removed meanwhile"):
            await editing.do(desk, "run", first, seen=())

    asyncio.run(cut())
    assert workspace.entry("run").steps == (first,)
    assert len(workspace.recording("run")) == 100


@pytest.mark.parametrize(("state", "told"), [("done", 0), ("cancelled", 1), ("failed", 1)])
def test_only_what_did_not_end_well_covers_the_page(
    state: str, told: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr("nicegui.ui.notify", lambda text, **how: said.append(how["position"]))
    shell._say(Job("pi", "fit", {}, state=state, message="no"))
    assert said == ["bottom"] * told

"""What happens while something is awaited counts; who shows a topic hears of its changes once each."""

from __future__ import annotations

import asyncio
import threading
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from nicegui.testing import User

from mckibben import PI, DataError, write
from mckibben.app import news, shell
from mckibben.app.busy import SOON, Answer, under_way
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.kept import Step
from mckibben.app.pages import drawing_reference, editing, forces
from mckibben.app.workspace import Workspace
from tests.app.simulated import (
    desk_of,
    held,
    later,
    modelled,
    on_compensate,
    only,
    simulated,
    visit,
    wave,
    workspace_of,
)

# -- while something is awaited ------------------------------------------------------------------


@pytest.mark.parametrize("clicked", [True, False])
def test_a_file_does_not_overwrite_a_motion_that_was_clicked_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clicked: bool
) -> None:
    path = tmp_path / "wished.csv"
    write(wave().select(["displacement"]), path)
    sketches: list[drawing_reference.Sketch] = []
    ready = drawing_reference.Sketch.ready

    async def sent(*_: Any) -> Path:
        return path

    def noted(self: drawing_reference.Sketch, kind: str) -> None:
        sketches.append(self)
        ready(self, kind)

    monkeypatch.setattr(drawing_reference, "kept", sent)
    monkeypatch.setattr(drawing_reference.Sketch, "ready", noted)

    async def look(user: User) -> None:
        await on_compensate(user)
        user.find(marker="wave").click()
        (sketch,) = sketches
        with held(monkeypatch, drawing_reference, "read_upload") as reading:
            load = asyncio.create_task(sketch._loaded(cast(Any, SimpleNamespace(file=None))))
            await later(reading.begun.is_set)
            if clicked:
                user.find(marker="wave-triangle").click()
            reading.go.set()
            with pytest.raises(DataError) if clicked else nullcontext():
                await load
        assert (sketch.file is None) == clicked

    visit(modelled(tmp_path, a=PI.example()), look)


def test_the_later_of_two_looks_counts_whichever_ends_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go, asked, desks = threading.Event(), list[int](), list[Desk]()
    build = forces.build

    def slow(desk: Desk) -> dict[str, list[str]]:
        asked.append(len(asked))
        if len(asked) == 1:
            assert go.wait(30.0)
            return {"older": ["pressure"]}
        return {"newer": ["pressure"]}

    def noted(desk: Desk) -> None:
        desks.append(desk)
        build(desk)

    monkeypatch.setattr(forces, "_tells", slow)
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
        visit(modelled(tmp_path, a=PI.example()), look)
    finally:
        go.set()


def test_a_part_of_what_is_not_there_any_more_is_not_cut(tmp_path: Path) -> None:
    workspace = workspace_of(tmp_path, run=wave())
    desk, first = desk_of(workspace), Step(do="slice", start=100, stop=200)

    async def cut() -> None:
        await editing.do(desk, "run", first, seen=())
        with pytest.raises(DataError):
            await editing.do(desk, "run", first, seen=())

    asyncio.run(cut())
    assert workspace.entry("run").steps == (first,)
    assert len(workspace.recording("run")) == 100


@pytest.mark.parametrize("clicked", [True, False])
def test_a_theme_chosen_by_a_click_stays(clicked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The browser's own theme is asked for when a page opens; its answer may come after a click."""
    desk = cast(Any, SimpleNamespace(dark=False, changed=lambda topic: None))
    dark = cast(Any, SimpleNamespace(value=None))
    dark.set_value = lambda value: setattr(dark, "value", value)

    async def answered(query: str, *, timeout: float) -> bool:
        if clicked:
            shell._switch(desk, dark, False)
        return not clicked

    monkeypatch.setattr(ui, "run_javascript", answered)
    asyncio.run(shell._match(desk, dark))
    assert (desk.dark, dark.value) == (True, True)
    shell._switch(desk, dark, True)
    assert (desk.dark, dark.value) == (False, False)


def test_a_second_click_does_nothing_twice_and_what_runs_is_listed() -> None:
    done: list[str] = []

    def root() -> None:
        async def slow() -> None:
            await asyncio.sleep(3 * SOON)
            done.append("slow")

        ui.button("Draw it", on_click=Answer(slow))

    async def look(user: User) -> None:
        assert user.client is not None
        for _ in range(3):
            user.find("Draw it").click()
        await asyncio.sleep(2 * SOON)
        (button,) = user.find("Draw it").elements
        assert [str(one) for one in under_way(user.client)] == ["Draw it"]
        assert "loading" in button.props
        await asyncio.sleep(3 * SOON)
        assert done == ["slow"]
        assert under_way(user.client) == []
        assert "loading" not in button.props
        user.find("Draw it").click()
        await later(lambda: done == ["slow", "slow"])

    simulated(root, look)


# -- who hears of what ---------------------------------------------------------------------------


class Page:
    """A page over a workspace that counts what it draws."""

    def __init__(self, folder: Path) -> None:
        self.desk = Desk(Workspace(folder), Jobs(Workspace(folder)))
        self.drawn: list[str] = []

    def __call__(self) -> None:
        self.desk.news.client = ui.context.client
        self.desk.news.open_tab = "one"
        for tab in ("one", "two"):
            with ui.column() as holder:
                self.desk.news.tabs[tab] = holder

                @ui.refreshable
                def shown(tab: str = tab) -> None:
                    ui.label(f"drawn {len(self.drawn)} {tab}")
                    self.drawn.append(tab)

                self.desk.when("results", shown.refresh)
                self.desk.when("channels", shown.refresh)
                shown()

    async def settled(self) -> None:
        for _ in range(200):
            await asyncio.sleep(0.01)
            if not self.desk.news._pending and not self.desk.news._at_work:
                return


def test_changes_are_drawn_once_where_they_are_seen_and_failures_are_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(news, "AGAIN", (0.01, 0.01))
    page, reported, tries = Page(tmp_path), list[Exception](), list[None]()

    def half_written() -> None:
        tries.append(None)
        if len(tries) < 3:
            raise ValueError("the file is just being written")

    async def look(_: User) -> None:
        page.drawn.clear()
        for _again in range(5):
            page.desk.changed("results", "channels")
        await page.settled()
        assert page.drawn == ["one"]
        page.desk.news.opened("two")
        await page.settled()
        assert page.drawn == ["one", "two"]
        page.desk.news.told = reported.append
        page.desk.when("results", half_written)
        page.desk.changed("results")
        await page.settled()
        await later(lambda: len(tries) == 3)
        assert reported == []
        tries[:] = []
        monkeypatch.setattr(news, "AGAIN", ())
        page.desk.changed("results")
        await page.settled()
        assert [type(error) for error in reported] == [ValueError]
        client = page.desk.news.client
        assert client is not None
        for _again in range(10):
            with client, ui.column() as place:
                page.desk.when("runs", lambda: None)
            place.delete()  # what listened there goes with it
        assert len(page.desk.news._listeners["runs"]) == 1

    simulated(page, look)

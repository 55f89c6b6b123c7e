"""Whoever shows a topic hears of its changes: once each, after failures too, and not when it is gone."""

from __future__ import annotations

import asyncio
import gc
import weakref
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

pytest.importorskip("nicegui")

from nicegui import Client, ui
from nicegui.testing import User, user_simulation

from mckibben.app import news, shell
from mckibben.app.busy import SOON, Answer, under_way
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.shell import build
from mckibben.app.workspace import Workspace


def simulated(root: Callable[[], None], look: Callable[[User], Awaitable[None]]) -> None:
    """Open a page without a browser, and look at it."""

    async def run() -> None:
        async with user_simulation(root) as user:
            try:
                await user.open("/")
                await look(user)
            finally:
                for client in Client.instances.values():
                    client.outbox.stop()

    asyncio.run(run())


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


async def settled(page: Page) -> None:
    for _ in range(200):
        await asyncio.sleep(0.01)
        if not page.desk.news._pending and not page.desk.news._at_work:
            return


def test_many_changes_at_once_are_drawn_once_and_hidden_tabs_when_they_are_opened(
    tmp_path: Path,
) -> None:
    page = Page(tmp_path)

    async def look(_: User) -> None:
        page.drawn.clear()
        for _again in range(5):
            page.desk.changed("results", "channels")
        await settled(page)
        assert page.drawn == ["one"]
        page.desk.news.opened("two")
        await settled(page)
        assert page.drawn == ["one", "two"]

    simulated(page, look)


def test_a_change_told_from_what_it_deletes_is_drawn_every_time(tmp_path: Path) -> None:
    """The button that changes something stands in what is drawn anew: it is gone by then."""
    page = Page(tmp_path)
    rounds = 40
    state = {"done": 0, "shown": -1, "other": -1}

    def root() -> None:
        page()

        @ui.refreshable
        def own() -> None:
            state["shown"] = state["done"]

            def more() -> None:
                state["done"] += 1
                page.desk.changed("recordings")
                page.desk.changed("results")

            ui.button("more", on_click=more)

        @ui.refreshable
        def other() -> None:
            state["other"] = state["done"]

        page.desk.when("recordings", own.refresh)
        page.desk.when("results", other.refresh)
        own()
        other()

    async def look(user: User) -> None:
        for number in range(1, rounds + 1):
            user.find("more").click()
            await settled(page)
            assert state == {"done": number, "shown": number, "other": number}

    simulated(root, look)


def test_what_fails_harms_nobody_else_and_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(news, "AGAIN", (0.01, 0.01))
    page, told, tries = Page(tmp_path), list[Exception](), list[None]()

    def root() -> None:
        def half_written() -> None:
            tries.append(None)
            if len(tries) < 3:
                raise ValueError("the file is just being written")

        page.desk.when("results", half_written)
        page()
        page.desk.news.told = told.append

    async def look(_: User) -> None:
        page.drawn.clear()
        page.desk.changed("results")
        await settled(page)
        assert page.drawn == ["one"]
        await asyncio.sleep(0.2)
        assert len(tries) == 3
        assert told == []
        tries[:] = []
        monkeypatch.setattr(news, "AGAIN", ())
        page.desk.changed("results")
        await settled(page)
        assert [str(error) for error in told] == ["the file is just being written"]

    simulated(root, look)


def test_listeners_go_with_what_they_show(tmp_path: Path) -> None:
    page = Page(tmp_path)

    async def look(_: User) -> None:
        client = page.desk.news.client
        assert client is not None
        for _again in range(10):
            with client, ui.column() as place:
                page.desk.when("runs", lambda: None)
            place.delete()
        assert len(page.desk.news._listeners["runs"]) == 1

    simulated(page, look)


def test_other_windows_hear_of_what_is_shared_and_a_closed_one_is_let_go(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    jobs = Jobs(workspace)
    desks: list[weakref.ref[Desk]] = []

    def root() -> None:
        desks.append(weakref.ref(build(workspace, jobs)))

    async def look(user: User) -> None:
        first = user.client
        await user.open("/")
        one, two = (desk() for desk in desks[-2:])
        assert one is not None
        assert two is not None
        heard: list[str] = []
        one.when("recordings", lambda: heard.append("recordings"))
        one.when("theme", lambda: heard.append("theme"))
        two.changed("recordings", "theme")
        await asyncio.sleep(0.2)
        assert heard == ["recordings"]
        del two
        assert first is not None
        first.delete()
        assert one.news._listeners == {}
        one.changed("recordings")
        page = weakref.ref(first)
        del one, first
        for _ in range(20):
            await asyncio.sleep(0.1)
            gc.collect()
            if page() is None:
                break
        assert page() is None

    simulated(root, look)


def test_a_second_click_does_nothing_twice_and_what_runs_is_said(tmp_path: Path) -> None:
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
        await asyncio.sleep(5 * SOON)
        assert done == ["slow", "slow"]

    simulated(root, look)


@pytest.mark.parametrize("clicked", [True, False])
def test_a_theme_chosen_by_a_click_stays(clicked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The browser's own theme is asked for when a page opens; its answer may come after a click."""
    desk = SimpleNamespace(dark=False, changed=lambda topic: None)
    dark = SimpleNamespace(value=None)
    dark.set_value = lambda value: setattr(dark, "value", value)

    async def answered(query: str, *, timeout: float) -> bool:
        if clicked:
            shell._switch(cast(Any, desk), cast(Any, dark), False)
        return not clicked

    monkeypatch.setattr(ui, "run_javascript", answered)
    asyncio.run(shell._match(cast(Any, desk), cast(Any, dark)))
    assert (desk.dark, dark.value) == (True, True)
    shell._switch(cast(Any, desk), cast(Any, dark), True)
    assert (desk.dark, dark.value) == (False, False)

"""Workspaces for tests, and the workbench over them without a browser."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from nicegui import Client, ui
from nicegui.testing import User, user_simulation

from mckibben import PI, Recording
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.shell import build, load_the_rest
from mckibben.app.workspace import Workspace
from mckibben.blocks.base import Block
from mckibben.rigs import load_rig
from mckibben.signals import decaying_triangle

WEAKER = replace(PI.example(), weights=tuple(0.9 * weight for weight in PI.example().weights))
CHANNELS = {"input": "pressure", "output": "displacement"}


def quiet(share: float, cost: float) -> None:
    """Do nothing with the progress of a job."""


def swung(period: float) -> Recording:
    """Return a minute of a virtual muscle under triangles that decay, with noise of its own."""
    time = np.arange(600) * 0.1
    pressure = decaying_triangle(time, period=period, high=5.0, low=1.0)
    return load_rig("mas20-hanging").run(Recording({"pressure": pressure}, 0.1), round(10 * period))


def wave() -> Recording:
    """Return a muscle without memory on a slow wave."""
    up = 2.0 - 2.0 * np.cos(np.arange(600) * 0.05)
    return Recording({"pressure": up, "displacement": 4.0 * up}, 0.1)


def workspace_of(folder: Path, **recordings: Recording) -> Workspace:
    """Return a workspace with recordings to train on."""
    workspace = Workspace(folder)
    for name, recording in recordings.items():
        workspace.add(recording, origin="a test", call="", name=name)
    return workspace


def filled(folder: Path) -> Workspace:
    """Return a workspace with a short recording to train on."""
    return workspace_of(folder, run=swung(10.0))


def modelled(folder: Path, **models: Block) -> Workspace:
    """Return a workspace with models."""
    workspace = Workspace(folder)
    for name, model in models.items():
        model.save(workspace.path("models", f"{name}.json"))
    return workspace


def asked(model: str, name: str, **settings: Any) -> dict[str, Any]:
    """Return what a fit is asked for with."""
    return {"model": model, "name": name, "settings": settings, "title": name} | CHANNELS


def desk_of(workspace: Workspace) -> Desk:
    """Return the desk of a page over a workspace, with its channels chosen."""
    desk = Desk(workspace, Jobs(workspace))
    desk.settle_channels()
    return desk


def visit(workspace: Workspace, look: Callable[[User], Awaitable[None]]) -> None:
    """Open the workbench over a workspace, without a browser, and look at it."""
    load_the_rest()  # which a page that is opened would wait for
    simulated(lambda: build(workspace, Jobs(workspace)), look)


def simulated(root: Callable[[], Any], look: Callable[[User], Awaitable[None]]) -> None:
    """Open a page without a browser, and look at it."""

    def page() -> None:
        root()

    async def run() -> None:
        async with user_simulation(page) as user:
            try:
                await user.open("/")
                await look(user)
            finally:
                for client in Client.instances.values():
                    client.outbox.stop()  # it can swallow a cancellation, and then would wait for ever

    before = dict(os.environ)
    asyncio.run(run())
    os.environ.clear()
    os.environ.update(before)


def only(user: User, marker: str) -> Any:
    """Return the one element of a name for tests."""
    (element,) = user.find(marker=marker).elements
    return element


def field(user: User, label: str) -> ui.number:
    (found,) = [one for one in user.find(ui.number).elements if one.props.get("label") == label]
    return found


async def until(user: User, marker: str) -> Any:
    """Wait for an element, and return one of its name."""
    await user.should_see(marker=marker, retries=200)
    return next(iter(user.find(marker=marker).elements))


async def gone(user: User, marker: str) -> None:
    await user.should_not_see(marker=marker, retries=200)


async def later(true: Callable[[], bool]) -> None:
    """Wait until something is so."""
    for _ in range(200):
        if true():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it is not so")


async def on_compensate(user: User) -> None:
    """Open the page that compensates."""
    user.find(marker="tab-compensate").click()
    await until(user, "wave")


async def drawn(user: User) -> None:
    """Show the pressures for a sine."""
    await on_compensate(user)
    user.find(marker="wave").click()
    user.find(marker="show-pressures").click()
    await until(user, "pressure-plot")

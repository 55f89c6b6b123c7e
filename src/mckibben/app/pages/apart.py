"""What keeps recordings from being fitted together, and buttons that mend it."""

from __future__ import annotations

import asyncio
from functools import partial

from nicegui import ui

from mckibben.app import adding
from mckibben.app.desk import LONGEST, Desk, guarded, labelled, named
from mckibben.app.fields import READING
from mckibben.app.kept import Step
from mckibben.app.pages import loads
from mckibben.app.together import differing, sample_times
from mckibben.estimators.coupled.base import schedules
from mckibben.files.notices import listed
from mckibben.signals.zeroing import apart as zeros_apart

SHOWN = 6
"""Names of recordings in a line."""


def build(desk: Desk) -> None:
    """Show what differs, where something does."""
    loads.build(desk)
    hindering(desk)
    _zeros(desk)


def hindering(desk: Desk) -> None:
    """Show what differs so that nothing may be fitted, and buttons that mend it; one thing at a time."""
    _channels(desk)
    if desk.workspace.channels():
        _sample_times(desk)


def common(times: tuple[float, float]) -> float:
    """Return the sample time to bring all to: the longest, in three digits [s].

    >>> common((0.01684, 0.01692))
    0.0169
    """
    return float(f"{times[1]:.3g}")


def _channels(desk: Desk) -> None:
    """Offer to set recordings aside where channels differ."""
    found, common = differing(desk), desk.workspace.channels()
    if not found:
        return
    with named(ui.card().classes("w-full border border-warning gap-1"), "different"):
        ui.label("These recordings have different channels").classes("font-medium")
        ui.label(
            f"All of them have only: {', '.join(common)}."
            if common
            else "No channel is in all of them: nothing can be fitted to them together. Where one is "
            "called otherwise, say so by “How it was read”."
        )
        if pairs := adding.pairs(desk.workspace):
            said = "; ".join(" with ".join(names) for names in pairs[:SHOWN])
            more = " …" if len(pairs) > SHOWN else ""
            with ui.row().classes("items-center w-full"):
                ui.label(f"As long, and of other channels: {said}{more}").classes(
                    "flex-1 min-w-40 text-sm break-words"
                )
                button = ui.button("Join them", on_click=guarded(partial(_join, desk, pairs)))
                named(button.props("outline dense"), "join")
        for channels, names in found.items():
            own = [channel for channel in channels if channel not in common]
            _aside(desk, names, f"{listed(names, SHOWN)}: {', '.join(own) or 'nothing else'}")


async def _join(desk: Desk, pairs: list[tuple[str, ...]]) -> None:
    for names in pairs:
        await asyncio.to_thread(adding.join, desk, names)
    desk.settle_channels()
    desk.changed("recordings", "channels", "log")


async def _set_aside(desk: Desk, names: list[str]) -> None:
    desk.workspace.set_role(names, "unused")
    desk.settle_channels()
    desk.changed("recordings", "channels")


def _sample_times(desk: Desk) -> None:
    """Offer one sample time where there are several: operators of rates and lags need one."""
    times = sample_times(desk)
    if times is None:
        return
    wanted = common(times)
    with named(ui.card().classes("w-full border border-warning gap-1"), "sample-times"):
        ui.label("These recordings have different sample times").classes("font-medium")
        said = f"From {times[0]:.4g} to {times[1]:.4g} s; models of one muscle need one."
        ui.label(said).classes("text-sm")
        button = ui.button(
            f"Resample all to {wanted:g} s", on_click=guarded(partial(_resample, desk, wanted))
        )
        named(button.props("outline dense no-caps"), "resample-all")


def _aside(desk: Desk, names: list[str], said: str) -> None:
    """Show names, and a button that sets them unused."""
    with ui.row().classes("items-center w-full"):
        ui.label(said[:LONGEST]).classes("flex-1 min-w-40 text-sm break-words")
        button = ui.button(
            f"Set {len(names)} unused", on_click=guarded(partial(_set_aside, desk, names))
        )
        labelled(button.props("outline dense"), "aria-label", f"Set {listed(names, SHOWN)} unused")
        named(button, f"aside-{names[0]}")


def _zeros(desk: Desk) -> None:
    """Offer one zero where one muscle's recordings rest at several, which a load may tell or not."""
    used = list(desk.workspace.used().values())
    (given, *more), (wanted, *others) = desk.inputs, desk.outputs
    known = all(given in one and wanted in one for one in used)
    if more or others or not known:
        return
    found = zeros_apart(used, wanted, given)
    if found is None:
        return
    unit = used[0].units[wanted]
    with named(ui.card().classes("w-full border border-warning gap-1"), "zeros"):
        ui.label(f"These recordings rest at different {wanted}").classes("font-medium")
        ui.label(
            f"From {found[0]:.3g} to {found[1]:.3g} {unit} where {given} is lowest: "
            + (
                f"the {told[0]} that is told may be why. Where it is not (a sensor zeroed anew, another "
                "muscle), give them one zero: what a load does at rest goes with it."
                if (told := schedules(used))
                else "a sensor was zeroed anew, or another load hung there. Models that are not told "
                f"take it for what {given} does. Of a load that you know, tell them: “{READING}”, "
                "“Add a constant”, a force in N."
            )
        ).classes("text-sm")
        button = ui.button(f"Zero {wanted} there", on_click=guarded(partial(_zero, desk)))
        named(button.props("outline dense no-caps"), "zero-all")


async def _zero(desk: Desk) -> None:
    (given,), channels = desk.inputs, list(desk.outputs)
    said, step = f"{channels[0]} zeroed", Step(do="zero", channels=channels, over=given)
    names = list(desk.workspace.used())
    await asyncio.to_thread(desk.workspace.edit_each, names, said, step)
    desk.changed("recordings", "channels", "log")


async def _resample(desk: Desk, wanted: float) -> None:
    used = desk.workspace.used()
    names = [name for name, run in used.items() if run.sample_time not in (None, wanted)]
    said, step = f"all resampled to {wanted:g} s", Step(do="resample", sample_time=wanted)
    await asyncio.to_thread(desk.workspace.edit_each, names, said, step)
    desk.changed("recordings", "channels", "log")

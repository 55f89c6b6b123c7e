"""Buttons that work while something slow is done, and cannot be pressed twice meanwhile."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from mckibben.app.desk import named, told


def once(label: str, action: Callable[[], Awaitable[Any]], name: str, **look: Any) -> ui.button:
    """Return a button that shows that it works until its action has ended, and starts it once.

    Parameters
    ----------
    label : str
    action : callable
        Its problems become messages.
    name : str
        That tests and people who script the page find it by.
    **look
        Of `nicegui.ui.button`.
    """
    works = False

    async def act() -> None:
        nonlocal works
        if works:
            return
        works = True
        button.props("loading")
        try:
            with told():
                await action()
        finally:
            works = False
            if not button.is_deleted:
                button.props(remove="loading")

    button = ui.button(label, on_click=act, **look)
    named(button, name)
    return button

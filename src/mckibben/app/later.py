"""What takes a while to make, shown once it is made: the page is there before it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

from nicegui import run, ui

from mckibben.app import widgets
from mckibben.errors import MckibbenError

T = TypeVar("T")

MOST = 48
"""Things that are remembered."""

_made: dict[Hashable, Any] = {}


def later(
    key: Hashable, make: Callable[[], T], show: Callable[[T], Any], *, height: int = 0
) -> None:
    """Show what ``make`` returns, or its error; it is called in a thread, and once for a key.

    The key is all that it depends on, and ``height`` [px] the room that is left for it meanwhile.
    """

    def shown() -> None:
        found = _made[key] = _made.pop(key)  # the last used goes last
        with place:
            (widgets.error_box if isinstance(found, MckibbenError) else show)(found)

    async def fill() -> None:
        try:
            if (made := await run.io_bound(make)) is None:
                return  # the page was left
            _made[key] = made
        except MckibbenError as error:
            _made[key] = error
        while len(_made) > MOST:
            del _made[next(iter(_made))]
        if not place.is_deleted:
            place.clear()
            shown()

    place = ui.element("div").classes("stack")
    if key in _made:
        shown()
        return
    with place, ui.element("div").classes("empty").style(f"min-height: {height}px"):
        ui.spinner()
    ui.timer(0.01, fill, once=True)

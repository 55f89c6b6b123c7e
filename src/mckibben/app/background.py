"""What takes a while to make, shown once it is made: the page is there before it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

from nicegui import run, ui

from mckibben.app import widgets
from mckibben.errors import MckibbenError

T = TypeVar("T")

MOST_CACHED = 48
"""Results that are kept in memory."""

_CACHE: dict[Hashable, Any] = {}


def later(
    key: Hashable, make: Callable[[], T], show: Callable[[T], Any], *, height: int = 0
) -> None:
    """Show what ``make`` returns, or its error; it is called in a thread, and once for a key.

    The key is all that it depends on, and ``height`` [px] the room that is left for it meanwhile.
    """

    def shown() -> None:
        found = _CACHE[key] = _CACHE.pop(key)  # the last used goes last
        with place:
            (widgets.error_box if isinstance(found, MckibbenError) else show)(found)

    async def fill() -> None:
        try:
            if (result := await run.io_bound(make)) is None:
                return  # the page was left
            _CACHE[key] = result
        except MckibbenError as error:
            _CACHE[key] = error
        while len(_CACHE) > MOST_CACHED:
            del _CACHE[next(iter(_CACHE))]
        if not place.is_deleted:
            place.clear()
            shown()

    place = ui.element("div").classes("stack")
    if key in _CACHE:
        shown()
        return
    with place, ui.element("div").classes("empty").style(f"min-height: {height}px"):
        ui.spinner()
    ui.timer(0.01, fill, once=True)

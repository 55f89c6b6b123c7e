"""Models by what they are for: what each can, needs and costs, and why the others have no place."""

from __future__ import annotations

import asyncio
import re
from typing import Any

from nicegui import binding, ui

from mckibben.app.desk import Desk, guarded, hinted, labelled, named
from mckibben.app.fields import said
from mckibben.app.offering import Offer, Offered, offered
from mckibben.app.pages import apart
from mckibben.app.pages.settings import ask
from mckibben.estimators.catalogue import Need

INVERSES = {
    "exact": "exact inverse",
    "exact where stable": "exact inverse, where that is stable",
    "solved": "inverse by solving",
    "none": "no inverse",
}


class Choice:
    """The models that are to be fitted, and their settings.

    Parameters
    ----------
    desk : Desk
    """

    possible = binding.BindableProperty()
    """Whether there is anything to fit."""

    def __init__(self, desk: Desk) -> None:
        self.possible = False
        self.desk = desk
        self.settings: dict[str, dict[str, str]] = {}
        self.ticked: list[str] = []
        self.shown: Offered | None = None
        self._looks = 0
        self.boxes: dict[str, ui.checkbox] = {}
        self.heads: list[tuple[Any, str, list[Offer]]] = []
        self.said = named(ui.label("Looking at the data …"), "recognised").classes("text-sm w-full")
        self.actions = ui.row().classes("w-full items-center gap-3")
        self.actions.set_visibility(False)
        self.place = ui.element("div").classes("w-full grid gap-x-4 lg:grid-cols-2 items-start")
        for topic in ("recordings", "channels"):
            desk.when(topic, guarded(self._offer))
        ui.timer(0.02, guarded(self._offer, "Looking for models"), once=True)

    async def _offer(self) -> None:
        self._looks = look = self._looks + 1
        found = await asyncio.to_thread(offered, self.desk)
        if look != self._looks or found == self.shown:  # a later look knows better
            return
        names = [offer.model for _, offers in found.groups for offer in offers]
        chosen = self.desk.workspace.ticked
        kept = [model for model in chosen or () if model in names]
        self.shown, self.ticked = found, kept if kept or chosen == [] else found.start
        self.said.set_text(said(found.recognised))
        self.possible = bool(found.groups)
        self.actions.set_visibility(True)
        self.place.clear()
        self.boxes, self.heads = {}, []
        with self.place:
            if not found.groups:
                apart.hindering(self.desk)
            for need, offers in found.groups:
                self._group(need, offers)
            self._others(found.against)
        self._count()

    def only(self, models: list[str]) -> None:
        """Tick some models and no others."""
        for model, box in self.boxes.items():
            box.set_value(model in models)

    def start(self) -> None:
        """Tick those to begin with."""
        self.only([] if self.shown is None else self.shown.start)

    def _group(self, need: Need, offers: list[Offer]) -> None:
        """Show the usual models, and those that are ticked; the others are one click away."""
        first = [one for one in offers if one.usual or one.model in self.ticked]
        ticked = any(one.model in self.ticked for one in offers)
        head = ui.expansion(need.title, value=ticked).classes("w-full min-w-0").props("dense")
        word = re.split(r"\W", need.title)[0].lower()
        self.heads.append((named(head, f"need-{word}"), need.title, offers))
        with head:
            ui.label(need.about).classes("text-xs opacity-70")
            for offer in first:
                self._model(offer)
            rest = [one for one in offers if one not in first]
            if not rest:
                return
            title = f"{len(rest)} more" if first else f"All {len(rest)}"
            with named(ui.expansion(title).classes("w-full").props("dense"), f"more-{word}"):
                for offer in rest:
                    self._model(offer)

    def _model(self, offer: Offer) -> None:
        with ui.row().classes("w-full items-center gap-x-2 gap-y-0 no-wrap"):
            box = ui.checkbox(
                value=offer.model in self.ticked,
                on_change=lambda event: self._tick(offer.model, event.value),
            )
            labelled(named(box.props("dense"), f"model-{offer.model}"), "aria-label", offer.title)
            self.boxes[offer.model] = box
            words = named(ui.column().classes("gap-0 flex-1 min-w-0"), f"about-{offer.model}")
            words.classes("cursor-pointer").on("click", lambda: box.set_value(not box.value))
            with words:
                ui.label(f"{offer.title} · {offer.model}").classes("text-sm break-words")
                ui.label(f"{offer.can} {_about(offer)}".strip()).classes(
                    "text-xs opacity-70 break-words"
                )
            button = ui.button(icon="tune", on_click=lambda: ask(offer.model, self.settings))
            hinted(button.props("flat dense"), "Settings")
            labelled(
                named(button, f"settings-{offer.model}"), "aria-label", f"Settings of {offer.model}"
            )

    def _others(self, against: dict[str, str]) -> None:
        if not against:
            return
        with ui.expansion(f"{len(against)} models have no place on these data").classes(
            "w-full min-w-0"
        ):
            for title, reason in against.items():
                ui.label(said(f"{title}: {reason}")).classes("text-xs opacity-70 break-words")

    def _tick(self, model: str, on: bool) -> None:
        self.ticked = [name for name in self.ticked if name != model] + [model] * on
        self.desk.workspace.ticked = self.ticked
        self._count()

    def _count(self) -> None:
        for head, title, offers in self.heads:
            n = sum(offer.model in self.ticked for offer in offers)
            head.props["label"] = f"{title} ({n} of {len(offers)} chosen)"
            head.update()


def _about(offer: Offer) -> str:
    words = [INVERSES[offer.inverse], _time(offer.seconds)]
    if offer.needs_time:
        words.append("needs time")
    if offer.caution:
        words.append(f"good only near its training: {offer.caution}")
    return f"{'; '.join(words)[0].upper()}{'; '.join(words)[1:]}."


def _time(seconds: float) -> str:
    """Return about how long a fit takes: how busy the machine is, nobody knows."""
    if seconds < 15:
        return "seconds"
    return "about a minute" if seconds < 90 else "minutes" if seconds < 1800 else "an hour or more"

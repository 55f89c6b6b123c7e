"""The drawer that models are chosen in: by what they are for, with reasons, and with their settings."""

from __future__ import annotations

import math
from functools import partial
from itertools import groupby
from typing import Any

from nicegui import run, ui

from mckibben.app import modelling, widgets
from mckibben.app.modelling import Offer, Offered
from mckibben.app.state import State
from mckibben.app.terms import said
from mckibben.app.widgets import mark
from mckibben.comparison.channels import Channels
from mckibben.errors import MckibbenError

OWN = ("input", "output", "scheduling")
"""Settings that are chosen as channels."""

INVERSES = {
    "exact": "exact inverse",
    "exact where stable": "exact inverse, where that is stable",
    "solved": "inverse by solving",
    "none": "no inverse",
}

Json = dict[str, Any]


async def choose(state: State) -> None:
    """Open the drawer."""
    sides = modelling.sides_of(state.workspace, state.inputs, state.outputs, state.load)
    with (
        ui.dialog(value=True).props("position=right full-height") as drawer,
        ui.element("div").classes("card drawer") as place,
    ):
        mark(place, "drawer")
        ui.spinner()
    drawer.on("hide", drawer.delete)
    offered: Offered | MckibbenError | None
    try:
        offered = await run.io_bound(modelling.offered, state.workspace, sides)
    except MckibbenError as error:
        offered = error
    if place.is_deleted or offered is None:
        return
    place.clear()
    with place:
        with widgets.row(classes="spread"):
            ui.label("Fit models").classes("subtitle").props('role=heading aria-level="2"')
            button = ui.button(icon="close", on_click=drawer.close)
            mark(button.props('flat round dense aria-label="Close"'), "close-drawer")
        if isinstance(offered, MckibbenError):
            widgets.error_box(offered)
            ui.link("Change recordings and channels →", "/")
        else:
            _Choice(state, sides, offered, drawer).build()


class _Choice:
    """What is ticked, and the controls that show it."""

    def __init__(self, state: State, sides: Channels, offered: Offered, drawer: Any) -> None:
        self.state, self.sides, self.offered, self.drawer = state, sides, offered, drawer
        known = [offer.model for offer in offered.offers]
        before = state.chosen.get("models.ticked", offered.quick)
        self.ticked = [name for name in before if name in known] or offered.quick
        self.settings: dict[str, Json] = state.chosen.setdefault("models.settings", {})
        self.boxes: dict[str, Any] = {}
        self.shared = bool(state.chosen.get("models.shared", False))

    def build(self) -> None:
        """Build the drawer's content; the button stays in sight."""
        with ui.element("div").classes("stack scroll"):
            self._data()
            with widgets.row():
                mark(widgets.button("Quick choice", lambda: self.only(self.offered.quick)), "quick")
                everything = [offer.model for offer in self.offered.offers]
                mark(widgets.button("All", lambda: self.only(everything)), "tick-all")
                mark(widgets.button("None", lambda: self.only([])), "tick-none")
            for need, offers in groupby(
                self.offered.offers, lambda offer: (offer.need, offer.about)
            ):
                self._group(*need, list(offers))
            if self.offered.others:
                with widgets.details(
                    f"{len(self.offered.others)} do not apply to these recordings"
                ):
                    for title, why in self.offered.others.items():
                        with ui.element("div"):
                            ui.label(title)
                            ui.label(said(why)).classes("muted")
        with widgets.row(classes="spread foot"):
            self.count = ui.label().classes("muted")
            self.button = mark(widgets.primary("Fit", self.fit), "fit")
        self._counted()

    def _data(self) -> None:
        sides = self.sides
        given = ", ".join(sides.inputs)
        told = f", given {', '.join(sides.scheduling)}" if sides.scheduling else ""
        with ui.element("div"):
            ui.label(f"{', '.join(sides.outputs)} of {given}{told}")
            split = self.offered.split
            ui.label(f"{split[:1].upper()}{split[1:]}.").classes("muted")
        with widgets.details("Which recordings to fit to, and to test on") as roles:
            mark(roles, "roles")
            for entry in self.state.workspace.entries():
                with widgets.row(classes="spread"):
                    ui.label(entry.name)
                    ui.toggle(
                        {"train": "Train", "test": "Test", "unused": "Unused"},
                        value=entry.role,
                        on_change=partial(self._role, entry.name),
                    ).props("dense no-caps unelevated")
            ui.checkbox("Allow the same data in training and test").bind_value(self, "shared")
            ui.link("Change inputs, outputs or load →", "/")

    async def _role(self, name: str, event: Any) -> None:
        """Give a recording a role; what applies to the recordings may be something else then."""
        await run.io_bound(self.state.workspace.change, name, role=event.value)
        self.drawer.close()
        self.state.changed()
        await choose(self.state)

    def _group(self, need: str, about: str, offers: list[Offer]) -> None:
        with ui.element("div"):
            ui.label(need).classes("subtitle").props('role=heading aria-level="3"')
            ui.label(about).classes("muted")
        first = [one for one in offers if one.usual or one.model in self.ticked]
        for offer in first:
            self._model(offer)
        if rest := [one for one in offers if one not in first]:
            with widgets.details(f"{len(rest)} more") as more:
                mark(more, f"more-{need.split()[0].strip(':,').lower()}")
                for offer in rest:
                    self._model(offer)

    def _model(self, offer: Offer) -> None:
        with ui.element("div").classes("model"):
            box = ui.checkbox(
                value=offer.model in self.ticked,
                on_change=lambda e: self._tick(offer.model, e.value),
            ).props(f'dense aria-label="{offer.title}"')
            self.boxes[offer.model] = mark(box, f"model-{offer.model}")
            with (
                ui.element("div")
                .classes("grow")
                .on("click", lambda: box.set_value(not box.value), [])
            ):
                ui.label(f"{offer.title} · {offer.model}")
                ui.label(f"{offer.can} {_about(offer)}").classes("muted")
            button = widgets.icon_button(
                "tune", f"Settings of {offer.model}", lambda: self._fold(offer, place)
            )
            mark(button, f"settings-{offer.model}")
            place = ui.element("div").classes("columns-even settings")
            place.set_visibility(False)

    def _fold(self, offer: Offer, place: Any) -> None:
        """Show the settings of a model, or hide them again."""
        from mckibben import registry
        from mckibben.estimators.core.settings import settings_with_defaults

        place.set_visibility(not place.visible)
        if place.visible and not place.default_slot.children:
            given = self.settings.setdefault(offer.model, {})
            with place:
                for one in settings_with_defaults(registry.load("estimators", offer.model)):
                    if one.name not in OWN:
                        mark(_field(one, given), f"set-{one.name}")

    def only(self, models: list[str]) -> None:
        """Tick some models and no others."""
        for model, box in self.boxes.items():
            box.set_value(model in models)

    def _tick(self, model: str, on: bool) -> None:
        self.ticked = [name for name in self.ticked if name != model] + [model] * on
        self.state.chosen["models.ticked"] = self.ticked
        self._counted()

    def _counted(self) -> None:
        n = len(self.ticked)
        seconds = sum(one.seconds for one in self.offered.offers if one.model in self.ticked)
        self.count.set_text(f"Takes {_time(seconds / self.state.jobs.at_once)}" if n else "")
        self.button.set_text(f"Fit {n} model{'s' * (n != 1)}")
        self.button.set_enabled(bool(n))

    def fit(self) -> None:
        """Start the fits, quick ones first."""
        from mckibben.estimators.catalogue import settings_of

        costs = {offer.model: offer.seconds for offer in self.offered.offers}
        sides, self.state.chosen["models.shared"] = self.sides, self.shared
        given = {
            "inputs": list(sides.inputs),
            "outputs": list(sides.outputs),
            "load": (sides.scheduling or ("",))[0],
            "allow_shared": self.shared,
        }
        chosen = sorted(self.ticked, key=costs.__getitem__)
        settings = {model: settings_of(model, self.settings.get(model, {})) for model in chosen}
        for job in [j for j in self.state.jobs.jobs.values() if j.kind == "fit" and not j.active]:
            self.state.jobs.forget(job.name)
        for model in chosen:
            more = given | {"model": model, "settings": settings[model]}
            self.state.jobs.submit(modelling.fit, model, **more)
        self.drawer.close()
        self.state.chosen.pop("models.picked", None)
        self.state.changed()


def _about(offer: Offer) -> str:
    words = [INVERSES.get(offer.inverse, ""), _time(offer.seconds)]
    if offer.caution:
        words.append(f"good only near its training: {offer.caution}")
    text = "; ".join(filter(None, words))
    return f"{text[:1].upper()}{text[1:]}."


def _time(seconds: float) -> str:
    """Return about how long a fit takes: how busy the machine is, nobody knows."""
    if seconds < 15:
        return "seconds"
    return "a minute" if seconds < 90 else "minutes" if seconds < 1800 else "an hour or more"


def _field(one: Any, given: Json) -> Any:
    """Make the control of a setting, of which what differs from the default is taken."""
    from mckibben.estimators.core.settings import setting_value

    def taken(event: Any) -> None:
        value = event.value
        if isinstance(value, str):
            value = setting_value(value) if value and one.kind == "text" else (value or None)
        if value is None or value == one.default:
            given.pop(one.name, None)
        else:
            given[one.name] = int(value) if one.kind == "whole" else value

    label, now = one.name.replace("_", " "), given.get(one.name, one.default)
    hint = one.meaning.replace("``", "")
    if one.kind == "flag" and not one.optional:
        return ui.checkbox(label, value=bool(now), on_change=taken).props("dense").tooltip(hint)
    if one.kind in ("choice", "flag"):
        options = {choice: str(choice) for choice in one.choices or (True, False)}
        options |= {None: "its own choice"} if one.optional else {}
        found: Any = ui.select(options, value=now, label=label, on_change=taken)
    elif one.kind in ("whole", "number"):
        ends = {"min": one.low, "max": one.high}
        limits = {key: end for key, end in ends.items() if math.isfinite(end)}
        found = ui.number(label, value=now, on_change=taken, placeholder="its own choice", **limits)
    else:
        text = "" if one.name not in given else str(given[one.name])
        found = ui.input(label, value=text, on_change=taken, placeholder=str(one.default))
    return found.props(
        "dense outlined stack-label hide-bottom-space" + f' hint="{hint}"'.replace("\n", " ")
    )

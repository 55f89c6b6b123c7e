"""The drawer that models are chosen in: by what they are for, with reasons."""

from __future__ import annotations

from functools import partial
from typing import Any

from nicegui import ui

from mckibben.app import modelling, widgets
from mckibben.app.background import later
from mckibben.app.modelling import Offered
from mckibben.app.state import State
from mckibben.app.terms import message_of
from mckibben.app.widgets import mark
from mckibben.channels import Channels
from mckibben.estimators.catalogue import Need, ability, declared, full_name

INVERSES = {
    "exact": "exact inverse",
    "exact where stable": "exact inverse, where that is stable",
    "solved": "inverse by solving",
    "none": "no inverse",
}


def choose(state: State) -> None:
    """Open the drawer."""
    sides = state.sides
    with (
        ui.dialog(value=True).props("position=right full-height") as drawer,
        ui.element("div").classes("card drawer") as place,
    ):
        mark(place, "drawer")
        with widgets.row(classes="spread"):
            with ui.element("div"):
                ui.label("Fit models").classes("subtitle").props('role=heading aria-level="2"')
                ui.link("Change recordings for training and test, or channels →", "/")
            mark(widgets.icon_button("close", "Close", drawer.close), "close-drawer")
        key = "offered", state.workspace.digest(), sides
        offer = partial(modelling.offered, state.workspace, sides)
        later(key, offer, lambda offered: _ModelChoice(state, sides, offered, drawer))
    drawer.on("hide", drawer.delete)


class _ModelChoice:
    """What is ticked, and the controls that show it."""

    def __init__(self, state: State, sides: Channels, offered: Offered, drawer: Any) -> None:
        self.state, self.sides, self.offered, self.drawer = state, sides, offered, drawer
        last_ticked = state.chosen.get("models.ticked", ())
        self.ticked = [name for name in last_ticked if name in offered.models] or offered.quick
        self.boxes: dict[str, Any] = {}
        further = f", given {', '.join(sides.further)}" if sides.further else ""
        sets = {"Quick choice": offered.quick, "All": offered.models, "None": []}
        with ui.element("div").classes("stack scroll"):
            with ui.element("div"):
                ui.label(f"{', '.join(sides.outputs)} over {', '.join(sides.inputs)}{further}")
                ui.label(f"{offered.split[:1].upper()}{offered.split[1:]}.").classes("muted")
            shared = ui.checkbox("Allow the same data in training and test").props("dense")
            shared.bind_value(state.chosen, "models.shared")
            with widgets.row():
                for title, models in sets.items():
                    button = widgets.button(title, partial(self._only, models))
                    mark(button, f"tick-{title.partition(' ')[0].lower()}")
            for need in offered.needs:
                self._need(need)
            if offered.others:
                with widgets.details(f"{len(offered.others)} do not apply to these recordings"):
                    for title, why in offered.others.items():
                        with ui.element("div"):
                            ui.label(title)
                            ui.label(message_of(why)).classes("muted")
        with widgets.row(classes="spread foot"):  # stays in sight
            self.count = ui.label().classes("muted")
            self.button = mark(widgets.primary("Fit", self._fit), "fit")
        self._show_count()

    def _need(self, need: Need) -> None:
        with ui.element("div"):
            ui.label(need.title).classes("subtitle").props('role=heading aria-level="3"')
            ui.label(need.about).classes("muted")
        prominent = {*self.offered.quick, *self.ticked} & {*need.models}
        for model in need.models:
            if model in prominent:
                self._model(model)
        if others := [model for model in need.models if model not in prominent]:
            with widgets.details(f"{len(others)} more"):
                for model in others:
                    self._model(model)

    def _model(self, model: str) -> None:
        kind, title = declared(model), full_name(model)
        about = [INVERSES.get(str(kind.inverse_kind), ""), _time(self.offered.seconds(model))]
        about += [f"good only near its training: {kind.caution}"] * bool(kind.caution)
        text = "; ".join(filter(None, about))

        with ui.element("div").classes("model"):
            box = ui.checkbox(value=model in self.ticked).props("dense")
            box.on_value_change(lambda event: self._tick(model, event.value))
            self.boxes[model] = mark(widgets.labelled(box, title), f"model-{model}")
            words = ui.element("div").classes("grow")
            with words.on("click", lambda: box.set_value(not box.value), []):
                ui.label(f"{title} · {model}")
                ui.label(f"{ability(model)} {text[:1].upper()}{text[1:]}.").classes("muted")

    def _only(self, models: list[str]) -> None:
        for model, box in self.boxes.items():
            box.set_value(model in models)

    def _tick(self, model: str, on: bool) -> None:
        self.ticked = [name for name in self.ticked if name != model] + [model] * on
        self.state.chosen["models.ticked"] = self.ticked
        self._show_count()

    def _show_count(self) -> None:
        n, seconds = len(self.ticked), sum(map(self.offered.seconds, self.ticked))
        self.count.set_text(f"Takes {_time(seconds / self.state.jobs.at_once)}" if n else "")
        self.button.set_text(f"Fit {n} model{'s' * (n != 1)}")
        self.button.set_enabled(bool(n))

    def _fit(self) -> None:
        """Start the fits, quick ones first."""
        sides, state = self.sides, self.state
        settings: dict[str, Any] = {"inputs": list(sides.inputs), "outputs": list(sides.outputs)}
        settings["load"] = state.load
        settings["allow_shared"] = bool(state.chosen.get("models.shared"))
        state.jobs.forget_ended("fit")
        for model in sorted(self.ticked, key=self.offered.seconds):
            state.jobs.submit(modelling.fit, model, model=model, **settings)
        self.drawer.close()
        state.chosen.pop("models.picked", None)
        state.changed()


def _time(seconds: float) -> str:
    """Return about how long a fit takes: how busy the machine is, nobody knows."""
    if seconds < 15:
        return "seconds"
    return "a minute" if seconds < 90 else "minutes" if seconds < 1800 else "an hour or more"

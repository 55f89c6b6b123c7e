"""The settings of a model as a form: every setting with what it means and what it may be."""

from __future__ import annotations

import math
from typing import Any

from nicegui import ui

from mckibben import registry
from mckibben.app.desk import labelled, named, tell
from mckibben.errors import ModelError
from mckibben.estimators.catalogue import full_name, settings_of
from mckibben.estimators.core.settings import Setting, setting_value, settings_with_defaults

CHANNELS = ("input", "output", "scheduling")
"""What is chosen elsewhere."""

OWN = "its own choice"
"""Of a setting that may be none."""

Written = dict[str, dict[str, str]]
"""By model and setting, what was asked for, as it is written on the command line."""


def ask(model: str, kept: Written) -> None:
    """Show the settings of a model; what differs from the defaults is kept."""
    found = settings_with_defaults(registry.load("estimators", model))
    found = [one for one in found if one.name not in CHANNELS]
    given = dict(kept.get(model, {}))
    with ui.dialog() as dialog, named(ui.card().classes("w-full max-w-3xl gap-2"), "settings"):
        ui.label(f"Settings of {full_name(model)}").classes("text-lg")
        for one in found:
            _field(one, given)

        def done() -> None:
            try:
                settings_of(model, {name: setting_value(text) for name, text in given.items()})
            except ModelError as error:
                tell(error)
                return
            kept[model] = given
            dialog.close()

        def defaults() -> None:
            kept.pop(model, None)
            dialog.close()

        with ui.row():
            named(ui.button("Use these", on_click=done), "settings-done")
            ui.button("Defaults", on_click=defaults).props("flat")
            ui.button("Close", on_click=dialog.close).props("flat")
    dialog.open()


def allowed(one: Setting) -> str:
    """Return what a number may be, in words."""
    low = f"from {one.low:g}" if math.isfinite(one.low) else ""
    high = f"to {one.high:g}" if math.isfinite(one.high) else ""
    said = " ".join(filter(None, (low, high)))
    return " ".join(filter(None, ("whole" if one.kind == "whole" else "", said)))


def _field(one: Setting, given: dict[str, str]) -> None:
    def changed(value: Any) -> None:
        text = "" if value is None else _text(value)
        if text in ("", _text(one.default)):
            given.pop(one.name, None)
        else:
            given[one.name] = text

    now = given.get(one.name)
    with ui.row().classes("w-full items-center gap-3 no-wrap"):
        field = _asked(one, now, changed).classes("w-56 shrink-0")
        named(field, f"set-{one.name}")
        labelled(field, "aria-label", one.name)
        hint = " ".join(filter(None, (f"({allowed(one)})" if allowed(one) else "", one.meaning)))
        ui.label(hint.replace("``", "")).classes("text-xs opacity-70 min-w-0 break-words")


def _asked(one: Setting, now: str | None, changed: Any) -> Any:
    label = one.name.replace("_", " ")
    default = OWN if one.default is None else _text(one.default)

    def told(event: Any) -> None:
        changed(event.value)

    if one.kind == "flag" and not one.optional:
        value = one.default if now is None else now == "true"
        return ui.checkbox(label, value=value, on_change=told)
    if one.kind in ("choice", "flag"):
        choices = one.choices or (True, False)
        options = {"": OWN} if one.optional else {}
        options |= {
            _text(choice): {"true": "yes", "false": "no"}.get(_text(choice), _text(choice))
            for choice in choices
        }
        value = now if now is not None else ("" if one.default is None else _text(one.default))
        return ui.select(options, value=value, label=label, on_change=told)
    if one.kind in ("whole", "number"):
        return ui.number(
            label,
            value=None if now is None else float(now),
            placeholder=default,
            min=one.low if math.isfinite(one.low) else None,
            max=one.high if math.isfinite(one.high) else None,
            precision=0 if one.kind == "whole" else None,
            on_change=told,
        ).props("stack-label clearable")
    return ui.input(label, value=now or "", placeholder=default, on_change=told).props(
        "stack-label"
    )


def _text(value: Any) -> str:
    """Return a value as it is written on the command line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and value.is_integer():
        return f"{value:.0f}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_text, value))}]"
    return "none" if value is None else str(value)

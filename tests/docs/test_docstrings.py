"""Every public argument is documented, and nothing that is documented is gone."""

from __future__ import annotations

import dataclasses
import inspect
import re
from typing import Any

import pytest

import mckibben
from mckibben import registry
from mckibben.comparison.limits import limits

EXPORTED = [
    name
    for name in mckibben.__all__
    if not name.startswith("__") and callable(getattr(mckibben, name))
]
PLUGINS = [
    (group, name)
    for group in ("blocks", "estimators", "signals", "setups", "envelopes")
    for name in registry.names(group)
]
COMMON = {
    *("input", "output", "initial", "seed", "progress", "kwargs", "args"),
    *("method", "maxiter", "tolerance", "name", "setup"),
}
"""Arguments that a base class documents for all."""


def parts(found: Any) -> set[str]:
    """Return the names that a docstring, or one of a base class, documents as parameters."""
    names: set[str] = set()
    found = inspect.unwrap(found)
    for cls in inspect.getmro(found) if inspect.isclass(found) else (found,):
        text = inspect.cleandoc(cls.__doc__ or "")
        for section in re.findall(
            r"Parameters\n-+\n(.*?)(?:\n\n?[A-Z][\w ]+\n-+\n|\Z)", text, re.S
        ):
            for line in re.findall(r"^(\*{0,2}[\w, *]+?)(?: : .*)?$", section, flags=re.M):
                names |= {word.strip(" *") for word in line.split(",")}
    return names


def arguments(found: Any) -> set[str]:
    found = inspect.unwrap(found)
    if dataclasses.is_dataclass(found):
        return {f.name for f in dataclasses.fields(found) if f.init and not f.name.startswith("_")}
    if inspect.isclass(found) and hasattr(found, "model_fields"):
        return set()  # rigs document every field in itself; `mckibben rig show` prints them
    signature = inspect.signature(found)
    return {
        name
        for name, parameter in signature.parameters.items()
        if not name.startswith("_")
        and parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
    }


def check(found: Any, label: str) -> None:
    undocumented = arguments(found) - parts(found) - COMMON - {"self", "cls"}
    refers = "those of `" in (found.__doc__ or "") or "As for `" in (found.__doc__ or "")
    assert not undocumented or refers, f"{label} does not document {sorted(undocumented)}"


@pytest.mark.parametrize("name", EXPORTED)
def test_every_public_argument_is_documented(name: str) -> None:
    found = getattr(mckibben, name)
    if not (inspect.isclass(found) and issubclass(found, Exception | Warning)):
        check(found, name)


@pytest.mark.parametrize(("group", "name"), PLUGINS)
def test_every_plugin_documents_its_arguments(group: str, name: str) -> None:
    check(registry.load(group, name), f"{group} {name}")


MODELS = registry.names("estimators")


def test_every_model_has_its_limits_and_nothing_else_has() -> None:
    assert sorted(limits()) == sorted(MODELS)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_says_what_it_can_and_cannot(name: str) -> None:
    known = limits()[name]
    assert set(known) <= {"can", "cannot", "caution"}
    assert known["can"].endswith(".")
    assert known["cannot"].endswith(".")
    assert not known.get("caution", "").endswith(".")

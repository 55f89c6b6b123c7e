"""What is on disk is registered, and what is registered is on disk and loads."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import mckibben
from mckibben import Block, ModelError
from mckibben.blocks.play_type.envelopes import Envelope
from mckibben.registry import PLUGINS, REPLACED, load, names

SOURCE = Path(mckibben.__file__).parent
EVERYTHING = [(group, name) for group in PLUGINS for name in PLUGINS[group]]


def modules_under(folder: str) -> Iterator[ModuleType]:
    """Import and give every module of a folder of the package, which may be absent."""
    for path in sorted((SOURCE / folder).rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        yield import_module(".".join(("mckibben", *parts)).removesuffix(".__init__"))


def concrete(base: type, *folders: str) -> set[type]:
    """Return the concrete subclasses of a class that the modules of some folders define."""
    return {
        value
        for folder in folders
        for module in modules_under(folder)
        for _, value in inspect.getmembers(module, inspect.isclass)
        if value.__module__ == module.__name__
        and issubclass(value, base)
        and not inspect.isabstract(value)
    }


def registered(group: str) -> set[Any]:
    return {inspect.unwrap(load(group, name)) for name in PLUGINS[group]}


@pytest.mark.parametrize(("group", "name"), EVERYTHING)
def test_loads(group: str, name: str) -> None:
    assert callable(load(group, name))


def test_every_block_is_registered() -> None:
    assert concrete(Block, "blocks") == registered("blocks")


def test_every_face_is_registered() -> None:
    from mckibben.report.notebook.face import Face

    assert concrete(Face, "report/notebook") == registered("faces")


def test_every_envelope_is_registered() -> None:
    assert concrete(Envelope, "blocks/play_type/envelopes") == registered("envelopes")


def test_every_published_model_is_registered() -> None:
    assert functions("papers", "published") == registered("published")


def test_every_estimator_is_registered() -> None:
    from mckibben.estimators.core.estimator import Estimator

    assert concrete(Estimator, "estimators") == registered("estimators")


def functions(folder: str, named: str = "") -> set[Any]:
    """Return the public functions that the modules of a folder define, or those so named."""
    return {
        value
        for module in modules_under(folder)
        if module.__name__.endswith(named)
        for name, value in inspect.getmembers(module, inspect.isfunction)
        if value.__module__ == module.__name__ and not name.startswith("_")
    }


def test_every_protocol_is_registered() -> None:
    from mckibben.signals.protocol import protocol

    assert functions("papers", "protocol") == registered("protocols")
    for name in PLUGINS["protocols"]:
        assert protocol(name).name == name


def test_every_excitation_is_registered() -> None:
    found = {
        function
        for function in functions("signals")
        if next(iter(inspect.signature(function).parameters), "") == "time"
    }
    assert found == registered("signals")


def test_every_setup_is_registered() -> None:
    from mckibben.rigs import Rig

    assert concrete(Rig, "rigs") == registered("setups")
    for name in PLUGINS["setups"]:
        assert load("setups", name).model_fields["setup"].default == name


def test_every_group_is_checked_here() -> None:
    assert set(PLUGINS) == {
        "blocks",
        "controllers",
        "envelopes",
        "estimators",
        "faces",
        "papers",
        "protocols",
        "published",
        "setups",
        "signals",
    }


@pytest.mark.parametrize("name", [name for name in mckibben.__all__ if not name.startswith("__")])
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(mckibben, name) is not None


def test_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(
        ModelError, match=r"no block named .ip.*Remedy: use one of activation-memory"
    ):
        load("blocks", "ip")


@pytest.mark.parametrize(
    ("group", "name"), [(group, name) for group in REPLACED for name in REPLACED[group]]
)
def test_a_name_that_is_gone_leads_to_what_does_its_work(group: str, name: str) -> None:
    successor = REPLACED[group][name]
    assert name not in names(group)
    with pytest.raises(ModelError, match=rf"{name}.*is gone. Remedy: use '{successor}'"):
        load(group, name)
    assert callable(load(group, successor))


def test_names_are_in_order() -> None:
    for group in PLUGINS:
        assert list(names(group)) == sorted(names(group))
        assert list(PLUGINS[group]) == sorted(PLUGINS[group])

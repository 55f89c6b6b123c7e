"""What is on disk is registered, and what is registered is on disk, loads and is what it says."""

from __future__ import annotations

import inspect
import sys
import types
from collections.abc import Callable, Iterator
from dataclasses import fields
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from sklearn.base import clone

import mckibben
from mckibben import Block, ModelError
from mckibben.blocks.hysteresis.envelopes import Envelope
from mckibben.blocks.parameters import Parametrised
from mckibben.estimators.core.estimator import Estimator
from mckibben.estimators.hysteresis.pi import PIEstimator
from mckibben.presets import Chosen, preset
from mckibben.registry import PLUGINS, REPLACED, load, names
from mckibben.rigs import Rig

SOURCE = Path(mckibben.__file__).parent
EVERYTHING = [(group, name) for group in PLUGINS for name in PLUGINS[group]]
PRESETS = [(group, name) for group, name in EVERYTHING if isinstance(load(group, name), Chosen)]


def modules_under(folder: str) -> Iterator[ModuleType]:
    """Import and give every module of a folder of the package."""
    for path in sorted((SOURCE / folder).rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        yield import_module(".".join(("mckibben", *parts)).removesuffix(".__init__"))


def concrete(base: type, folder: str) -> set[Any]:
    """Return the subclasses that the modules of a folder define, but those that others begin with."""
    return {
        value
        for module in modules_under(folder)
        for _, value in inspect.getmembers(module, inspect.isclass)
        if value.__module__ == module.__name__
        and issubclass(value, base)
        and not inspect.isabstract(value)
        and (hasattr(value, "kind") or not issubclass(value, Parametrised))
    }


ON_DISK: dict[str, Callable[[], set[Any]]] = {
    "blocks": lambda: concrete(Block, "blocks") | concrete(Block, "estimators"),
    "envelopes": lambda: concrete(Envelope, "blocks/hysteresis"),
    "estimators": lambda: concrete(Estimator, "estimators"),
    "setups": lambda: concrete(Rig, "rigs"),
}


@pytest.mark.parametrize("group", PLUGINS)
def test_what_is_on_disk_is_registered_in_order_and_loads(group: str) -> None:
    registered = {inspect.unwrap(load(group, name)) for name in names(group)}
    assert all(callable(found) for found in registered)
    if group in ON_DISK:
        assert ON_DISK[group]() == registered
    assert list(PLUGINS[group]) == sorted(PLUGINS[group])
    assert list(names(group)) == sorted(names(group))


def test_every_public_name_is_there() -> None:
    assert all(getattr(mckibben, name) is not None for name in mckibben.__all__)


def test_an_unknown_name_is_refused_and_one_that_is_gone_leads_to_its_successor() -> None:
    with pytest.raises(ModelError, match=r"(?s)'ip'.*activation-memory"):
        load("blocks", "ip")
    for group, replaced in REPLACED.items():
        for name, successor in replaced.items():
            assert name not in names(group)
            with pytest.raises(ModelError, match=f"{name}.*'{successor}'"):
                load(group, name)
            assert callable(load(group, successor))


@pytest.mark.parametrize("name", names("estimators"))
def test_an_estimator_is_at_most_three_classes_deep(name: str) -> None:
    made = inspect.unwrap(load("estimators", name))
    above = [base for base in made.__mro__ if issubclass(base, Estimator)]
    assert len(above) <= 3, [base.__name__ for base in above]


@pytest.mark.parametrize("name", names("blocks"))
def test_a_block_is_at_most_three_classes_deep(name: str) -> None:
    above = [base for base in load("blocks", name).__mro__ if issubclass(base, Block)]
    assert len(above) <= 3, [base.__name__ for base in above]


# -- presets: a class with settings chosen ---------------------------------------------------------


@pytest.mark.parametrize(("group", "name"), PRESETS)
def test_a_preset_makes_its_class_with_its_settings(group: str, name: str) -> None:
    chosen = load(group, name)
    made = chosen()
    assert type(made) is inspect.unwrap(chosen)
    assert {field.name: field.default for field in fields(chosen)} == made.get_params()
    assert clone(made).get_params() == made.get_params()
    assert chosen.settings.items() <= made.get_params().items()
    assert chosen(seed=3).get_params() == made.get_params() | {"seed": 3}


def test_settings_override_those_of_a_preset_and_others_are_refused_by_its_name() -> None:
    p2 = load("estimators", "p2")
    assert (p2(structure="P3").structure, p2().structure) == ("P3", "P2")
    with pytest.raises(TypeError, match=r"'p2'.*'poles'.*structure"):
        p2(poles=2)


def test_another_package_gives_a_preset_by_an_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    outside = types.ModuleType("outside")
    outside.few = preset(PIEstimator, "A PI model of three operators.", n_operators=3)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "outside", outside)
    entry = EntryPoint("pi-of-three", "outside:few", "mckibben.estimators")
    monkeypatch.setattr(mckibben.registry, "entry_points", lambda group: [entry])
    mckibben.registry._locations.cache_clear()
    try:
        assert "pi-of-three" in names("estimators")
        assert load("estimators", "pi-of-three")().n_operators == 3
    finally:
        mckibben.registry._locations.cache_clear()


def test_estimators_are_abstract_or_final() -> None:
    ours = concrete(Estimator, "estimators")
    for cls in ours:
        overridden = [base for base in cls.__mro__[1:] if base in ours]
        assert not overridden, f"{cls} overrides {overridden[0]}: give that a setting instead"

"""What is on disk is registered, and what is registered is on disk, loads and is what it says."""

from __future__ import annotations

import inspect
import pickle
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
from mckibben.estimators.catalogue import defaults, full_name, settings_of
from mckibben.estimators.core.estimator import Estimator
from mckibben.registry import PLUGINS, load, names
from mckibben.rigs import Rig
from tests.refusals import refused

SOURCE = Path(mckibben.__file__).parent
EVERYTHING = [(group, name) for group in PLUGINS for name in PLUGINS[group]]


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
    registered = {load(group, name) for name in names(group)}
    assert all(callable(found) for found in registered)
    if group in ON_DISK:  # a class of which there are presets alone is not registered itself
        bases = {base for found in registered for base in found.__bases__}
        assert ON_DISK[group]() - bases <= registered <= ON_DISK[group]()
    assert list(PLUGINS[group]) == sorted(PLUGINS[group])
    assert list(names(group)) == sorted(names(group))


def test_every_public_name_is_there() -> None:
    assert all(getattr(mckibben, name) is not None for name in mckibben.__all__)


def test_an_unknown_name_is_refused() -> None:
    with refused(ModelError, names=("'ip'", "activation-memory")):
        load("blocks", "ip")


@pytest.mark.parametrize("name", names("blocks"))
def test_a_block_is_at_most_three_classes_deep(name: str) -> None:
    above = [base for base in load("blocks", name).__mro__ if issubclass(base, Block)]
    assert len(above) <= 3, [base.__name__ for base in above]


# -- estimators and presets ------------------------------------------------------------------------


def presets() -> list[type[Estimator]]:
    """Return the registered estimators that change defaults of another that can be fitted."""
    found = [load("estimators", name) for name in names("estimators")]
    return [made for made in found if not inspect.isabstract(made.__bases__[0])]


class Third(load("estimators", "p2uz")):  # type: ignore[misc]
    """A user's preset: settings, declarations and a setting of its own."""

    title = "Third order"
    structure = "P3"
    n_starts = 2
    own: float = 1.0


@pytest.mark.parametrize(
    "made", [*(load("estimators", name) for name in names("estimators")), Third]
)
def test_an_estimator_is_a_class_of_its_own(made: type[Estimator]) -> None:
    above = [base for base in made.__mro__[1:] if issubclass(base, Estimator)]
    assert len(above) <= 3 + (made is Third), [base.__name__ for base in above]
    assert made.title not in {base.title for base in above}
    assert made.__dict__["__doc__"]
    assert pickle.loads(pickle.dumps(made)) is made
    again = clone(made(seed=3))
    assert (type(again), again.get_params()) == (made, made().get_params() | {"seed": 3})
    with pytest.raises(TypeError, match="nothing"):
        made(nothing=1)


@pytest.mark.parametrize("made", presets())
def test_a_preset_changes_defaults_and_declarations_alone(made: type[Estimator]) -> None:
    base, own = made.__bases__[0], {name for name in vars(made) if not name.startswith("_")}
    assert own <= set(dir(base)) | {setting.name for setting in fields(base)}
    assert not any(inspect.isroutine(vars(made)[name]) for name in own)
    assert made().get_params().keys() == base().get_params().keys()


def test_a_default_alone_has_the_type_of_the_class_above() -> None:
    assert (Third().structure, Third().n_starts, Third().n_refined, Third().own) == ("P3", 2, 4, 1)
    assert (Third.title, Third.quick) == ("Third order", True)
    for wrong in ({"structure": "P9"}, {"n_starts": 0}, {"own": "much"}):
        with pytest.raises(ModelError) as caught:
            Third(**wrong).check_settings()
        assert caught.value.parameter in wrong


def test_another_package_gives_a_preset_by_an_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("third", f"{__name__}:Third", "mckibben.estimators")
    monkeypatch.setattr(mckibben.registry, "entry_points", lambda group: [entry])
    mckibben.registry._locations.cache_clear()
    try:
        assert "third" in names("estimators")
        assert load("estimators", "third") is Third
        assert full_name("third") == "Third order"
        assert defaults("third")["structure"] == "P3"
        assert settings_of("third", {"own": 2.0}) == {"own": 2.0}
    finally:
        mckibben.registry._locations.cache_clear()

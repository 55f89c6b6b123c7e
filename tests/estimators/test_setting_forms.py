"""Settings as forms ask for them: kinds, limits and choices agree with what is accepted."""

from __future__ import annotations

from typing import Any

import pytest

from mckibben import registry
from mckibben.comparison.offered import defaults, settings_of
from mckibben.errors import ModelError
from mckibben.estimators.core.settings import Setting, settings_with_defaults


def of(model: str) -> dict[str, Setting]:
    return {one.name: one for one in settings_with_defaults(registry.load("estimators", model))}


@pytest.mark.parametrize("model", registry.names("estimators"))
def test_every_setting_has_a_form_and_a_meaning(model: str) -> None:
    found = of(model)
    assert {name: one.default for name, one in found.items()} == defaults(model)
    for one in found.values():
        assert one.meaning, one.name
        if one.kind == "choice":
            assert one.default in one.choices or one.default is None
        if one.kind in ("whole", "number") and one.default is not None:
            assert one.low <= one.default <= one.high


def test_kinds() -> None:
    gpi, balance = of("gpi"), of("balance")
    assert (gpi["n_operators"].kind, gpi["n_operators"].high) == ("whole", 1000)
    assert gpi["envelope"].choices == ("tanh", "piecewise-linear", "exponential")
    assert gpi["nonnegative"].kind == "flag"
    assert (balance["slack"].kind, balance["slack"].optional) == ("flag", True)
    assert balance["lags"].kind == "text"


@pytest.mark.parametrize(("name", "text"), [("n_operators", "1001"), ("envelope", "round")])
def test_what_is_beyond_the_form_is_refused(name: str, text: str) -> None:
    with pytest.raises(ModelError, match=name):
        settings_of("gpi", [f"{name}={text}"])
    found: Any = of("gpi")[name]
    assert found.high < 1001 if found.kind == "whole" else text not in found.choices

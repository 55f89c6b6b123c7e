"""Settings as they are written, and whose they are."""

from __future__ import annotations

import pytest

from mckibben import ModelError, registry
from mckibben.comparison.needs import full_name
from mckibben.comparison.offered import settings_of, settings_of_all, summary


def test_a_model_is_told_by_what_it_can_and_not_by_how_it_is_fitted() -> None:
    for model in registry.names("estimators"):
        said = summary(model)
        assert said.startswith(f"{full_name(model)}. ")
        assert "variable projection" not in said
    assert "Asymmetric, saturating loops between two envelopes" in summary("gpi")


def test_settings_of_another_model_are_refused() -> None:
    for name in ("gpi", "pii"):
        with pytest.raises(ModelError, match=f"is of {name}, and this is pi"):
            settings_of("pi", [f"{name}.seed=3"])


def test_settings_are_read_as_json_or_words() -> None:
    found = settings_of(
        "pi",
        [
            "n_operators=7",
            "nonnegative=false",
            "spacing=dense",
            "thresholds=[0, 0.5]",
            "pi.seed=3",
        ],
    )
    assert found == {
        "n_operators": 7,
        "nonnegative": False,
        "spacing": "dense",
        "seed": 3,
        "thresholds": (0, 0.5),
    }
    with pytest.raises(ModelError, match="Remedy"):
        settings_of("pi", ["n_operators"])


def test_a_bare_setting_goes_to_the_models_that_have_it() -> None:
    found = settings_of_all(["pi", "bouc-wen"], ["n_operators=7", "bouc-wen.seed=3"])
    assert found == {"pi": {"n_operators": 7}, "bouc-wen": {"seed": 3}}
    with pytest.raises(ModelError, match="none of the models"):
        settings_of_all(["bouc-wen"], ["n_operators=7"])

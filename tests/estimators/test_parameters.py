"""Estimators without scikit-learn for a base are what it takes for estimators."""

from __future__ import annotations

import inspect
from dataclasses import fields

import pytest
from sklearn.base import clone, is_classifier, is_regressor
from sklearn.exceptions import NotFittedError
from sklearn.utils import get_tags

from mckibben import GPIEstimator
from mckibben.registry import load, names

ALL = [("estimators", name) for name in names("estimators")]


@pytest.mark.parametrize(("group", "name"), ALL)
def test_settings_are_the_arguments_and_survive_cloning(group: str, name: str) -> None:
    estimator = load(group, name)(seed=7)
    settings = estimator.get_params()
    assert settings.keys() == inspect.signature(type(estimator)).parameters.keys()
    chosen = dict.fromkeys(settings) | {
        field.name: field.default for field in fields(load(group, name))
    }
    assert settings == chosen | {"seed": 7}
    copied = clone(estimator)
    assert copied is not estimator
    assert copied.get_params() == settings
    assert type(estimator)(**settings).get_params() == settings
    again = eval(repr(estimator), {type(estimator).__name__: type(estimator)})
    assert again.get_params() == settings


def test_scikit_learn_takes_it_for_neither_classifier_nor_regressor() -> None:
    estimator = GPIEstimator()
    assert not is_classifier(estimator)
    assert not is_regressor(estimator)
    assert not get_tags(estimator).target_tags.required


def test_settings_change_by_name_or_are_refused() -> None:
    estimator = GPIEstimator().set_params(n_operators=4, input="length")
    assert (estimator.n_operators, estimator.input) == (4, "length")
    assert repr(estimator) == "GPIEstimator(input='length', n_operators=4)"
    with pytest.raises(ValueError, match=r"'n_operator' .*GPIEstimator.* Remedy: .*n_operators"):
        estimator.set_params(seed=3, n_operator=5)
    assert estimator.seed == 0


def test_predicting_before_fitting_is_what_scikit_learn_calls_it() -> None:
    with pytest.raises(NotFittedError, match="call fit first"):
        _ = GPIEstimator().fitted

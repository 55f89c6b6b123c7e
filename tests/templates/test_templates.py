"""The templates for authors work as they stand: loaded from their path, registered, checked."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import cross_val_score

from mckibben import PI, ModelError, Recording, check_block, registry
from mckibben import load as load_model
from mckibben.blocks.derivatives import derivatives, differentiable
from mckibben.errors import DataError
from tests.export.building import build
from tests.refusals import refused
from tests.tools import needs

TEMPLATES = Path(__file__).parents[2] / "docs" / "templates"
README = (TEMPLATES / "README.md").read_text(encoding="utf-8")
U = np.interp(np.arange(400), np.arange(0, 400, 37), [0, 4, 1, 3, 2, 5, 0, 2.5, 2, 4.5, 3])


@pytest.fixture
def my_model(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Register the template as its README says, from where it lies, and import it."""
    lines = re.findall(r'"(\w+)": \{[^}]*?"([\w-]+)": "mckibben\.[\w.]+:(\w+)"', README)
    assert [group for group, *_ in lines] == ["models"]
    for group, kind, name in lines:
        monkeypatch.setitem(registry.PLUGINS[group], kind, f"my_model:{name}")
    monkeypatch.syspath_prepend(TEMPLATES)
    registry._locations.cache_clear()
    yield import_module("my_model")
    registry._locations.cache_clear()


@pytest.fixture
def estimator(my_model: ModuleType) -> Any:
    return registry.load("estimators", "elastic-plastic")


def test_template_obeys_the_contract(my_model: ModuleType) -> None:
    block = my_model.ElasticPlastic.example()
    for seed in range(5):
        check_block(block, seed=seed)
        check_block(block.inverse(), seed=seed)
    with refused(ModelError, names=-1):
        my_model.ElasticPlastic(1.0, -2.0, 0.4, (0.0, 5.0)).inverse()
    with refused(ModelError, parameter="threshold"):
        my_model.ElasticPlastic(1.0, -2.0, -0.4)


@pytest.mark.parametrize("weight", [-1.5, 0.0, 2.0])
def test_template_is_a_two_operator_prandtl_ishlinskii_model(
    my_model: ModuleType, weight: float
) -> None:
    model = my_model.ElasticPlastic(4.0, weight, 0.4, (0.0, 5.0))
    same = PI((0.0, 0.4), (4.0 + weight, -weight), 0.0, (0.0, 5.0))
    np.testing.assert_allclose(model.simulate(U), same.simulate(U), atol=1e-12)
    for ends, expected in zip(model.reachable(), same.reachable(), strict=True):
        np.testing.assert_allclose(ends, expected, atol=1e-12)
    check_block(model)


def test_the_estimator_finds_the_block(
    my_model: ModuleType, estimator: Any, tmp_path: Path
) -> None:
    truth = my_model.ElasticPlastic(4.0, 2.5, 0.4, (0.0, 5.0))
    recording = Recording({"pressure": U, "displacement": truth.simulate(U)}, 0.01)
    found = estimator().fit(recording)
    assert clone(found).fit(recording).model_ == found.model_
    np.testing.assert_allclose(found.model_.pack(), truth.pack(), atol=1e-9)
    found.model_.save(tmp_path / "model.json")
    assert load_model(tmp_path / "model.json") == found.model_
    check_block(found.model_.inverse())
    assert cross_val_score(estimator(), [recording] * 3, cv=3).min() > 1 - 1e-9
    with refused(DataError, channel="force"):
        estimator(output="force").fit(recording)
    falling = -3.0 * np.sin(U) + 0.3 * np.random.default_rng(0).standard_normal(U.size)
    noise = Recording({"pressure": U, "displacement": falling}, 0.01)
    with pytest.raises(ModelError):  # no better than the mean
        estimator().fit(noise)


def test_derivatives_are_exact_and_standard_errors_follow(
    my_model: ModuleType, estimator: Any
) -> None:
    truth, noise = my_model.ElasticPlastic(4.0, 2.5, 0.4, (0.0, 5.0)), 0.05
    assert differentiable(truth)
    slopes = derivatives(truth, U[:, np.newaxis])[:, 0]
    play = PI((0.4,), (1.0,), 0.0, (0.0, 5.0)).simulate(U)
    np.testing.assert_allclose(slopes[:, 0], U, atol=1e-12)
    np.testing.assert_allclose(slopes[:, 1], U - play, atol=1e-12)
    scatter = noise * np.random.default_rng(0).standard_normal(U.size)
    recording = Recording({"pressure": U, "displacement": truth.simulate(U) + scatter}, 0.01)
    found = estimator().fit(recording)
    errors = np.array(found.diagnostics_.standard_errors)
    expected = noise * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    np.testing.assert_allclose(errors, expected, rtol=0.2)
    assert (np.abs(found.model_.pack() - truth.pack()) < 4.0 * errors).all()


@needs("cc")
@pytest.mark.parametrize("initial", ["first_sample", "virgin"])
@pytest.mark.parametrize("inverse", [False, True])
def test_the_c_is_the_block(
    my_model: ModuleType, inverse: bool, initial: str, tmp_path: Path
) -> None:
    block = my_model.ElasticPlastic(4.0, -1.5, 0.4, (0.0, 5.0), initial=initial)
    given = U[:, np.newaxis]
    if inverse:
        block, given = block.inverse(), block.simulate(given)
    outputs = build({"model": block}, "double", tmp_path)["model"](given)
    np.testing.assert_allclose(outputs, block.simulate(given), rtol=0, atol=1e-12)

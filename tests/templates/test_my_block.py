"""The template for authors works as it stands: loaded from its path, registered, checked."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from mckibben import PI, ModelError, check_block, registry

TEMPLATES = Path(__file__).parents[2] / "docs" / "templates"


@pytest.fixture
def my_block(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Register the template as its README says, from where it lies, and import it."""
    lines = re.findall(r'"([\w-]+)": "[\w.]+:(\w+)"', (TEMPLATES / "README.md").read_text())
    for kind, name in lines:
        monkeypatch.setitem(registry.PLUGINS["blocks"], kind, f"my_block:{name}")
    monkeypatch.syspath_prepend(TEMPLATES)
    registry._locations.cache_clear()
    yield import_module("my_block")
    registry._locations.cache_clear()


def test_template_obeys_the_contract(my_block: ModuleType) -> None:
    for name in ("ElasticPlastic", "ElasticPlasticInverse"):
        for seed in range(5):
            check_block(getattr(my_block, name).example(), seed=seed)


@pytest.mark.parametrize("weight", [-1.5, 0.0, 2.0])
def test_template_is_a_two_operator_prandtl_ishlinskii_model(
    my_block: ModuleType, weight: float
) -> None:
    model = my_block.ElasticPlastic(4.0, weight, 0.4, (0.0, 5.0))
    same = PI((0.0, 0.4), (4.0 + weight, -weight), 0.0, (0.0, 5.0))
    u = np.interp(np.arange(400), np.arange(0, 400, 37), [0, 4, 1, 3, 2, 5, 0, 2.5, 2, 4.5, 3])
    np.testing.assert_allclose(model.simulate(u), same.simulate(u), atol=1e-12)
    for ends, expected in zip(model.reachable(), same.reachable(), strict=True):
        np.testing.assert_allclose(ends, expected, atol=1e-12)
    check_block(model)


def test_template_says_why_there_is_no_inverse(my_block: ModuleType) -> None:
    with pytest.raises(ModelError, match=r"add up to -1.*Remedy:"):
        my_block.ElasticPlastic(1.0, -2.0, 0.4).inverse()
    with pytest.raises(ModelError, match=r"threshold.*Remedy:"):
        my_block.ElasticPlastic(1.0, -2.0, -0.4)


def test_readme_names_files_that_exist() -> None:
    text = (TEMPLATES / "README.md").read_text()
    blocks = TEMPLATES.parents[1] / "src" / "mckibben" / "blocks"
    for name in re.findall(r"`(\w+(?:\.py|/))`", text):
        assert (blocks / name).exists() or (TEMPLATES / name).exists()

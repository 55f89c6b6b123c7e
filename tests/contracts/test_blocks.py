"""Every registered block obeys the contract, and every published model too."""

from __future__ import annotations

from pathlib import Path

import pytest

from mckibben import Block, check_block
from mckibben.blocks.laws.examples import examples
from mckibben.registry import load, names

EXAMPLES = examples()


@pytest.mark.parametrize("title", EXAMPLES)
def test_obeys_the_contract(title: str) -> None:
    block = EXAMPLES[title]
    for seed in range(3):
        check_block(block, sample_time=0.01, seed=seed)


@pytest.mark.parametrize("kind", names("blocks"))
def test_is_registered_under_its_own_kind(kind: str) -> None:
    block = load("blocks", kind)
    assert block.kind == kind
    assert type(block.example()) is block


@pytest.mark.parametrize("name", names("published"))
def test_published_models_obey_the_contract(name: str) -> None:
    model = load("published", name)()
    assert isinstance(model, Block)
    check_block(model, sample_time=0.001)


@pytest.mark.parametrize("title", EXAMPLES)
def test_saved_file_gives_the_block_back(title: str, tmp_path: Path) -> None:
    from mckibben import load as load_model

    block = EXAMPLES[title]
    block.save(tmp_path / "model.json")
    assert load_model(tmp_path / "model.json") == block

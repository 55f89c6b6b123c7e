"""Models that earlier versions saved still load, and still give what they gave.

``0.1.0-fitted.json`` holds what estimators found that are gone since: their files stream and export.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import Block, load
from mckibben.export import export_c
from mckibben.export.c.building import CompiledModel
from tests.saved.writing import SAMPLE_TIME
from tests.tools import needs


def saved(*paths: Path) -> list[Any]:
    return [
        pytest.param(content, id=f"{path.stem} {name}")
        for path in paths
        for name, content in json.loads(path.read_text(encoding="utf-8")).items()
    ]


FOLDER = Path(__file__).parent
GONE = saved(FOLDER / "0.1.0-fitted.json")


def loaded(content: dict[str, Any], folder: Path) -> Block:
    path = folder / "model.json"
    path.write_text(json.dumps(content["model"]), encoding="utf-8")
    return load(path)


def given(block: Block, content: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return inputs and outputs as they were, shapes (n, inputs) and (n, outputs)."""
    rows = np.array(content["inputs"]).reshape(-1, len(block.inputs))
    return rows, np.array(content["outputs"]).reshape(-1, len(block.outputs))


@pytest.mark.parametrize("content", saved(*sorted(FOLDER.glob("*.json"))))
def test_an_older_file_gives_what_it_gave(content: dict[str, Any], tmp_path: Path) -> None:
    outputs = loaded(content, tmp_path).simulate(
        np.array(content["inputs"]), sample_time=SAMPLE_TIME
    )
    np.testing.assert_allclose(outputs, content["outputs"], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("content", GONE)
def test_what_is_no_longer_fitted_streams_and_is_inverted(
    content: dict[str, Any], tmp_path: Path
) -> None:
    block = loaded(content, tmp_path)
    inputs, outputs = given(block, content)
    stream = block.stream(SAMPLE_TIME)
    stepped = [stream.step(row).copy() for row in inputs]
    np.testing.assert_allclose(stepped, outputs, rtol=1e-9, atol=1e-9)
    assert block.inverse().inverse() == block


@needs("cc")
@pytest.mark.parametrize("content", GONE)
def test_what_is_no_longer_fitted_is_exported(content: dict[str, Any], tmp_path: Path) -> None:
    block = loaded(content, tmp_path)
    inputs, outputs = given(block, content)
    export_c(block, tmp_path / "c", name="muscle", sample_time=SAMPLE_TIME)
    found, statuses = CompiledModel(
        tmp_path / "c", "muscle", len(block.inputs), len(block.outputs)
    ).run(inputs)
    assert not statuses.any()
    np.testing.assert_allclose(found, outputs, rtol=1e-9, atol=1e-9)

"""Models that earlier versions saved still load, and still give what they gave."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import load
from tests.saved.writing import SAMPLE_TIME

SAVED = [
    pytest.param(content, id=f"{path.stem} {name}")
    for path in sorted(Path(__file__).parent.glob("*.json"))
    for name, content in json.loads(path.read_text(encoding="utf-8")).items()
]


@pytest.mark.parametrize("content", SAVED)
def test_an_older_file_gives_what_it_gave(content: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(json.dumps(content["model"]), encoding="utf-8")
    outputs = load(path).simulate(np.array(content["inputs"]), sample_time=SAMPLE_TIME)
    np.testing.assert_allclose(outputs, content["outputs"], rtol=1e-9, atol=1e-9)

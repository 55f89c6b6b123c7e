"""mckibben check: words, validation.json and a page; errors that say what to do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import PI, Recording, write
from mckibben.signals import triangle
from tests.attacks.commands import call

TRUE = PI(thresholds=(0.0, 0.3, 0.6), weights=(3.0, 1.0, 0.7))


@pytest.fixture
def files(tmp_path: Path) -> Path:
    u = triangle(np.arange(0, 40, 0.02), 5.0, [5.0, 3.0, 4.0])
    noise = np.random.default_rng(0).standard_normal(u.size)
    y = TRUE.simulate(u) + 0.1 * noise
    write(Recording({"pressure": u, "displacement": y}, 0.02), tmp_path / "run.csv")
    write(Recording({"pressure": u, "displacement": y + 0.3}, 0.02), tmp_path / "off.csv")
    TRUE.save(tmp_path / "model.json")
    return tmp_path


def test_a_check_leaves_words_numbers_and_a_page(files: Path) -> None:
    done = call("check", files / "model.json", files / "run.csv", "-o", files / "out")
    assert done.code == 0, done.err
    told = json.loads((files / "out" / "validation.json").read_text())
    assert told["right"]
    assert told["outputs"][0]["p_whiteness"] > 0.0005
    page = (files / "out" / "report.html").read_text()
    assert told["verdict"].split(":")[0] in page
    assert told["verdict"].split(":")[0] in done.out
    again = call("check", files / "model.json", files / "off.csv", "-o", files / "out", "--json")
    assert again.code == 0, again.err
    told = json.loads(again.out)
    assert "0.3" in told["verdict"]
    assert told["outputs"][0]["missing"][0]["kind"] == "offset"


def test_a_recording_in_the_place_of_the_model_is_refused(files: Path) -> None:
    swapped = (files / "run.csv", files / "model.json")
    for words in (
        ("check", *swapped, "-o", files / "out"),
        ("simulate", *swapped, "-o", files / "out.csv"),
        ("calibrate", *swapped, "-o", files / "out.json"),
        ("check", files / "model.json", files / "none.csv", "-o", files / "out"),
    ):
        refused = call(*words)
        assert refused.code == 2
        assert "Remedy" in refused.err
        assert any(name in refused.err for name in ("run.csv", "none.csv"))

"""mckibben check: words, validation.json and a page; errors that say what to do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import PI, PerChannel, Recording, check, write
from mckibben.blocks.core.fields import Channel
from mckibben.report.check_page import check_page
from mckibben.signals import triangle
from mckibben.validation.describing import describe
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


def test_every_output_has_its_part_of_the_page() -> None:
    parts = tuple(
        PI(
            TRUE.thresholds,
            TRUE.weights,
            input=Channel(f"pressure_{k}", "bar"),
            output=Channel(f"displacement_{k}", "mm"),
        )
        for k in (1, 2)
    )
    time, runs = np.arange(0, 30, 0.02), []
    for seed, name in enumerate(("first", "<b>second")):
        channels = {f"pressure_{k}": triangle(time, 4.0 + k, [5.0, 3.0]) for k in (1, 2)}
        for k in (1, 2):
            noise = np.random.default_rng([k, seed]).standard_normal(time.size)
            channels[f"displacement_{k}"] = TRUE.simulate(channels[f"pressure_{k}"]) + 0.1 * noise
        runs.append(Recording(channels, 0.02, meta={"name": name}))
    model = PerChannel(parts)
    page = check_page(check(model, runs), describe(model, runs), "model.json")
    for place, output in enumerate(("displacement_1", "displacement_2")):
        assert f'<section id="output-{place}">' in page
        assert (
            output in page.partition(f'<section id="output-{place}">')[2].partition("<section")[0]
        )
    assert "&lt;b&gt;second" in page
    assert "<b>second" not in page

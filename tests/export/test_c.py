"""Exported C gives Python's numbers: all blocks and compositions, compiled once for each precision."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from mckibben import Block, ModelError, Series
from mckibben.blocks.adaptive import Adaptive
from mckibben.exporting import export_c
from mckibben.exporting.programs import self_test
from mckibben.registry import load
from mckibben.stream import Step
from tests.export.building import FLAGS, SAMPLE_TIME, Compiled, build
from tests.export.models import MODELS, difference, nearby, path_for, simulated
from tests.tools import needs

pytestmark = [pytest.mark.long, needs("cc")]

DOUBLE, SINGLE, GROWN = 1e-12, 1e-4, 1e-8
"""Largest difference allowed, relative to the range; `GROWN` of what learns, over a long run."""

OVERFLOWING: dict[str, Block] = {
    "overflowing": load("blocks", "polynomial")((0.0, 1e303, 1e303)),
    "overflowing memory": Series((load("blocks", "affine")(1e306, 0.0), MODELS["creep"])),
}
"""Of absurd parameters, at 1000 mm."""

DOUBLES = {
    name: nearby(block, np.random.default_rng(len(name))) for name, block in MODELS.items()
} | OVERFLOWING
"""Of other parameters than the examples."""

LASTING = ("creep", "gpi-inverse", "maxwell-slip", "multistate-friction", "process-model")


@pytest.fixture(scope="module")
def double(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Compiled]:
    return build(DOUBLES, "double", tmp_path_factory.mktemp("double"))


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Compiled]:
    return build(
        {name: MODELS[name] for name in LASTING}, "float32", tmp_path_factory.mktemp("single")
    )


@pytest.mark.parametrize("name", MODELS)
def test_double_precision_is_python(name: str, double: dict[str, Compiled]) -> None:
    block = DOUBLES[name]
    inputs = path_for(block, 1, 3000)
    outputs, expected = double[name](inputs), simulated(block, inputs)
    assert difference(outputs, expected) <= DOUBLE
    if isinstance(block, Adaptive):  # what learns remembers rounding
        inputs = path_for(block, 1, 100_000)
        assert difference(double[name](inputs), simulated(block, inputs)) <= GROWN


@pytest.mark.parametrize("name", LASTING)
def test_single_precision_does_not_drift(name: str, single: dict[str, Compiled]) -> None:
    block = MODELS[name]
    inputs = path_for(block, 3, 1_000_000).astype(np.float32).astype(np.float64)
    outputs, expected = single[name](inputs), simulated(block, inputs)
    assert difference(outputs[-100_000:], expected[-100_000:]) <= SINGLE


def test_outputs_are_always_finite(double: dict[str, Compiled]) -> None:
    """The last good output is repeated; memory that overflowed starts afresh."""
    for name in OVERFLOWING:
        inputs, stream = (
            [[np.nan], [1.0], [1e3], [2.0], [3.0]],
            Step(OVERFLOWING[name], SAMPLE_TIME),
        )
        double[name].reset()
        outputs, statuses = double[name].run(inputs)
        np.testing.assert_array_equal(statuses, [1, 0, 2, 0, 0])
        assert outputs[0] == 0.0
        assert outputs[2] == outputs[1]
        np.testing.assert_allclose(outputs, [stream(row) for row in inputs], rtol=1e-12)


def test_exports_link_into_one_program_and_test_themselves(tmp_path: Path) -> None:
    """Of both precisions, as they are written: functions of each have names of their own."""
    objects = []
    for name, single in (("coarse", True), ("fine", False)):
        export_c(MODELS["pi"], tmp_path / name, name=name, single=single)
        shown = re.findall(r"(?<!\S)\d[\d.]*(?:e[-+]\d+)?(?!\S)", self_test(tmp_path / name, name))
        worst, limit = map(float, shown)
        assert worst <= limit
        assert limit == pytest.approx(SINGLE if single else DOUBLE)
        for source in sorted((tmp_path / name / "src").glob("*.c")):
            objects.append(source.with_suffix(".o"))
            subprocess.run(["cc", *FLAGS, "-fPIC", "-c", source, "-o", objects[-1]], check=True)
    library = tmp_path / "both.so"
    subprocess.run(["cc", "-shared", *objects, "-lm", "-o", library], check=True)


def test_the_self_test_fails_for_another_model(tmp_path: Path) -> None:
    block = MODELS["pi"]
    own = export_c(block, tmp_path / "own", name="muscle")
    other = block.unpack(block.pack() * (1 + 1e-6))
    source = export_c(other, tmp_path / "other", name="muscle") / "src" / "muscle.c"
    (own / "src" / "muscle.c").write_bytes(source.read_bytes())
    with pytest.raises(ModelError):
        self_test(own, "muscle")


@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only"])
def test_code_without_infinity_is_refused(flag: str, tmp_path: Path) -> None:
    """Such code would take the guards against NaN away."""
    folder = tmp_path / "code"
    export_c(MODELS["pi"], folder, name="muscle")
    compiling = ["cc", "-std=c99", "-O3", "-c", "src/muscle.c", "-o", "muscle.o"]
    assert subprocess.run(compiling, cwd=folder, capture_output=True).returncode == 0
    refused = subprocess.run([*compiling, flag], cwd=folder, capture_output=True, text=True)
    assert refused.returncode != 0
    assert "-ffinite-math-only" in refused.stderr

"""Exported C under the checkers of others: sanitizers, cppcheck, MISRA, C++, Octave."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from mckibben.exporting import export_c
from mckibben.exporting.c.language import FUNCTIONS
from tests.export.building import FLAGS, SAMPLE_TIME
from tests.export.models import MODELS, difference, path_for, simulated
from tests.tools import needs

pytestmark = pytest.mark.long

DOCS = Path(__file__).parents[2] / "docs" / "deploy"
SHOWN = (
    "SDCHM inverse",
    "MPI-NARMAX",
    "preisach-inverse",
    "multistate-friction",
    "feedforward-feedback",
)


def run(command: Sequence[str | Path], cwd: Path) -> str:
    found = subprocess.run(
        [str(word) for word in command], cwd=cwd, capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stdout + found.stderr
    return found.stdout + found.stderr


@needs("clang")
@pytest.mark.parametrize("single", [False, True], ids=["double", "float32"])
@pytest.mark.parametrize("name", SHOWN)
def test_sanitizers_find_nothing(name: str, single: bool, tmp_path: Path) -> None:
    folder = export_c(MODELS[name], tmp_path / "c", sample_time=SAMPLE_TIME, single=single)
    sanitizers = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
    sources = [*sorted((folder / "src").glob("*.c")), folder / "test" / "model_selftest.c"]
    command = ["clang", *FLAGS, "-O0", *sanitizers, "-Isrc"]
    run([*command, *sources, "-lm", "-o", "selftest"], folder)
    run([folder / "selftest"], folder)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return the C of all models, each in a folder of its own."""
    folder = tmp_path_factory.mktemp("exported")
    places = [folder / f"{k}" for k in range(len(MODELS))]
    for place, block in zip(places, MODELS.values(), strict=True):
        export_c(block, place, sample_time=SAMPLE_TIME)
    return [place / "src" for place in places]


@needs("cppcheck")
def test_cppcheck_finds_nothing(exported: list[Path]) -> None:
    command = ["cppcheck", "--std=c99", "--enable=warning,style,performance,portability", "-q"]
    command += ["--error-exitcode=2", "--suppress=missingIncludeSystem"]
    # places that sizes rule out at run time are looked for without these
    command += ["--suppress=unusedStructMember", "--suppress=ctuArrayIndex"]
    command += ["--suppress=ctuPointerArith"]
    for folder in exported:
        run([*command, folder / "model.c"], folder)


@needs("cppcheck")
def test_misra_findings_are_those_that_are_justified(exported: list[Path]) -> None:
    found: set[str] = set()
    for folder in exported:
        told = run(["cppcheck", "--std=c99", "--addon=misra", "-q", "model.c"], folder)
        found |= set(re.findall(r"misra-c2012-([\d.]+)", told))
    page = (DOCS / "misra.md").read_text(encoding="utf-8")
    listed = {
        rule
        for row in re.findall(r"^\| ([\d., ]+) \|", page, flags=re.M)
        for rule in row.split(", ")
    }
    assert found, "the add-on did not run"
    assert found == listed


@needs("gcc")
def test_only_mathematics_is_asked_of_the_library(exported: list[Path]) -> None:
    for folder in exported:
        command = ["gcc", "-std=c99", "-O2", "-fno-stack-protector", "-fno-pie", "-c"]
        run([*command, "model.c", "-o", "model.o"], folder)
        undefined = set(re.findall(r" U (\w+)", run(["nm", "-u", "model.o"], folder)))
        foreign = {name for name in undefined if not name.startswith(("model_", "_GLOBAL"))}
        assert foreign <= FUNCTIONS | {"memset", "memcpy", "memmove"}, "which compilers add"
        writable = run(["nm", "model.o"], folder)
        assert not re.findall(r" [bBdD] ", writable), "nothing is kept outside the struct"


@needs("mkoctfile")
@needs("octave-cli")
def test_octave_gives_pythons_numbers(tmp_path: Path) -> None:
    block = MODELS["SDCHM inverse"]
    folder = export_c(block, tmp_path / "c", name="muscle", sample_time=SAMPLE_TIME)
    inputs = path_for(block, 1, 200)
    expected = simulated(block, inputs)
    inputs.astype("<f8").tofile(folder / "u.bin")
    script = f"""
        run(fullfile('matlab', 'build.m')); addpath('matlab');
        f = fopen('u.bin'); u = fread(f, [{len(block.inputs)} Inf], 'double')'; fclose(f);
        [y, status] = muscle_mex(u);
        muscle_mex('reset');
        z = [muscle_mex('step', u(1:50, :)); muscle_mex('step', u(51:end, :))];
        f = fopen('y.bin', 'w'); fwrite(f, [y status z]', 'double'); fclose(f);
    """
    run(["octave-cli", "--no-gui", "--norc", "--eval", script], folder)
    table = np.fromfile(folder / "y.bin").reshape(len(inputs), -1)
    n = len(block.outputs)
    assert difference(table[:, :n], expected) <= 1e-12
    assert not table[:, n].any()
    np.testing.assert_array_equal(table[:, n + 1 :], table[:, :n])

"""Exported C under the checkers of others: sanitizers, cppcheck, MISRA, C++, Octave."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from mckibben.export import export_c
from mckibben.export.c.parts import PRIMITIVES
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


@needs("cppcheck")
def test_cppcheck_finds_nothing(tmp_path: Path) -> None:
    (tmp_path / "mck_config.h").write_text("")
    command = ["cppcheck", "--std=c99", "--enable=warning,style,performance,portability", "-q"]
    command += ["--error-exitcode=2", "--suppress=missingIncludeSystem"]
    run([*command, f"-I{tmp_path}", *sorted(PRIMITIVES.glob("*.c"))], PRIMITIVES)
    for name in SHOWN:
        folder = export_c(MODELS[name], tmp_path / name, sample_time=SAMPLE_TIME) / "src"
        run([*command, "--suppress=unusedStructMember", folder / "model.c"], folder)


@needs("cppcheck")
def test_misra_findings_are_those_that_are_justified(tmp_path: Path) -> None:
    # the add-on leaves files beside the sources, at which another run of it would stumble
    folder = tmp_path / "primitives"
    shutil.copytree(PRIMITIVES, folder)
    (folder / "mck_config.h").write_text("")
    told = run(
        ["cppcheck", "--std=c99", "--addon=misra", "-q", *sorted(folder.glob("*.c"))], folder
    )
    found = set(re.findall(r"misra-c2012-([\d.]+)", told))
    page = (DOCS / "misra.md").read_text(encoding="utf-8")
    listed = {
        rule
        for row in re.findall(r"^\| ([\d., ]+) \|", page, flags=re.M)
        for rule in row.split(", ")
    }
    assert found, "the add-on did not run"
    assert found == listed


@needs("gcc")
def test_only_mathematics_is_asked_of_the_library(tmp_path: Path) -> None:
    allowed = {"atan", "atanh", "exp", "expm1", "log", "log1p", "sqrt", "tan", "tanh"}
    primitives = tmp_path / "primitives"
    shutil.copytree(PRIMITIVES, primitives)
    (primitives / "mck_config.h").write_text("")
    models = [export_c(MODELS[name], tmp_path / name, sample_time=SAMPLE_TIME) for name in SHOWN]
    for folder in (primitives, *(model / "src" for model in models)):
        objects = []
        for source in sorted(folder.glob("*.c")):
            objects.append(source.with_suffix(".o"))
            command = ["gcc", "-std=c99", "-O2", "-fno-stack-protector", "-fno-pie", "-c"]
            run([*command, source, "-o", objects[-1]], folder)
        undefined = set(re.findall(r" U (\w+)", run(["nm", "-u", *objects], folder)))
        foreign = {name for name in undefined if not name.startswith(("mck_", "model_", "_GLOBAL"))}
        assert foreign <= allowed | {"memset", "memcpy", "memmove"}, "which compilers add"
        writable = run(["nm", *objects], folder)
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

"""An FMU whose importer is hostile: null pointers, wrong order, odd numbers, damaged states."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from mckibben import Series
from mckibben.export.fmu.unit import fmu_files
from mckibben.registry import load
from tests.tools import needs

IMPORTER = Path(__file__).with_name("hostile_importer.c")
SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")


@pytest.mark.long
@needs("clang")
def test_a_hostile_importer_is_refused_and_breaks_nothing(tmp_path: Path) -> None:
    block = Series((load("blocks", "creep").example(), load("blocks", "preisach").example()))
    for path, content in fmu_files(block, sample_time=0.01).items():
        if path.startswith("sources/"):
            (tmp_path / Path(path).name).write_bytes(content)
    sources = [*tmp_path.glob("*.c"), IMPORTER]
    program = tmp_path / "importer"
    command = ["clang", "-std=c99", "-O1", "-g", *SANITIZERS, "-DFMI=2", f"-I{tmp_path}"]
    subprocess.run([*command, *map(str, sources), "-lm", "-o", str(program)], check=True)
    done = subprocess.run([str(program)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr

"""An FMU whose importer is hostile: null pointers, wrong order, odd numbers, damaged states."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest

from mckibben import Series
from mckibben.export.fmu.unit import fmu_files
from mckibben.registry import load
from tests.tools import needs

IMPORTER = Path(__file__).with_name("hostile_importer.c")
SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")


def sanitizers(folder: Path) -> tuple[str, ...]:
    """Return the flags of the sanitizers, where programs built with them run."""
    program = str(folder / "empty")
    command = ["cc", *SANITIZERS, "-x", "c", "-", "-o", program]
    text = "int main(void) { return 0; }"
    built = subprocess.run(command, input=text, text=True, capture_output=True, check=False)
    runs = built.returncode == 0 and subprocess.run([program], check=False).returncode == 0
    return SANITIZERS if runs else ()


@pytest.mark.long
@needs("cc")
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_hostile_importer_is_refused_and_breaks_nothing(version: Any, tmp_path: Path) -> None:
    block = Series((load("blocks", "creep").example(), load("blocks", "preisach").example()))
    flags = sanitizers(tmp_path)
    for path, content in fmu_files(block, version=version, sample_time=0.01).items():
        if path.startswith("sources/"):
            (tmp_path / Path(path).name).write_bytes(content)
    sources = [*tmp_path.glob("*.c"), IMPORTER]
    program = tmp_path / "importer"
    command = ["cc", "-std=c99", "-O1", "-g", *flags, f"-DFMI={version[0]}", f"-I{tmp_path}"]
    subprocess.run([*command, *map(str, sources), "-lm", "-o", str(program)], check=True)
    done = subprocess.run([str(program)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr

"""Results are written to a folder by one process at a time, and a dead one is in nobody's way."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from mckibben.errors import DataError
from mckibben.system.results import results_in

HOLDS = """
import sys, time
from pathlib import Path
from mckibben.system.results import results_in
with results_in(Path(sys.argv[1]), []):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_folder_is_held_as_long_as_its_process_lives(tmp_path: Path) -> None:
    holding = subprocess.Popen(
        [sys.executable, "-c", HOLDS, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert holding.stdout is not None
        assert holding.stdout.readline() == "held\n"
        with pytest.raises(DataError, match=str(tmp_path)):
            enter(tmp_path)
    finally:
        holding.kill()
        holding.communicate()
    for _ in range(2):  # and left again
        enter(tmp_path)
    enter(None)
    assert not tmp_path.exists() or not list(tmp_path.iterdir())


def enter(folder: Path | None) -> None:
    with results_in(folder, []):
        pass

"""Other people's programs: finding a C compiler, and running one that must succeed."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from mckibben.errors import ModelError

TIMEOUT = 600.0
"""Of a compiler, a self-test or an emulator [s]."""


def own_compiler() -> str | None:
    """Return the C compiler of this machine, $CC, cc, gcc or clang; None where there is none."""
    wanted = [name for name in (os.environ.get("CC"), "cc", "gcc", "clang") if name]
    return next((path for path in map(shutil.which, wanted) if path), None)


def run(command: Sequence[str], failed: str, *, folder: Path | None = None) -> str:
    """Run a program in a folder and return what it prints.

    Parameters
    ----------
    command : sequence of str
    failed : str
        What to say where it does not succeed, before its first complaint.
    folder : Path, optional
        Where to run it.

    Raises
    ------
    ModelError
        If it does not succeed.
    """
    found = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT, check=False
    )
    if found.returncode != 0:
        complaint = found.stderr.strip() or found.stdout.strip()
        raise ModelError(f"{failed}: {complaint[:500]} Remedy: report it, with the model.")
    return found.stdout

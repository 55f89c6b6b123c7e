"""Warnings about what was assumed or mended, shown at the line that called the package."""

from __future__ import annotations

import inspect
import warnings
from pathlib import Path

from mckibben.errors import DataWarning

_HERE = str(Path(__file__).parent)


def warn(path: Path, text: str) -> None:
    """Issue a `DataWarning` about a file."""
    frame, level = inspect.currentframe(), 0
    while frame is not None and frame.f_code.co_filename.startswith(_HERE):
        frame, level = frame.f_back, level + 1
    warnings.warn(f"{path}: {text}", DataWarning, stacklevel=level + 1)

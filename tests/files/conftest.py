"""Measured files, which are not part of the repository."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("MCKIBBEN_DATA", Path(__file__).parents[3] / "shared" / "data"))


@pytest.fixture
def measured() -> Callable[..., Path]:
    """Return the path of a measured file, or skip the test where it is absent."""

    def path(folder: str, name: str | None = None) -> Path:
        found = SHARED / folder / f"{name or folder}.csv"
        if not found.is_file():
            pytest.skip(f"{found} is not here")
        return found

    return path

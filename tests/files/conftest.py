"""Measured files, which are not part of the repository."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.recordings import MEASURED


@pytest.fixture
def measured() -> Callable[..., Path]:
    """Return the path of a measured file, or skip the test where it is absent."""

    def path(folder: str, name: str | None = None) -> Path:
        found = MEASURED / folder / f"{name or folder}.csv"
        if not found.is_file():
            pytest.skip(f"{found} is not here")
        return found

    return path

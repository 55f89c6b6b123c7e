from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mckibben import GPI, Recording, write
from mckibben.signals import irregular_triangle, triangle
from tests.golden.commands import Result, call

Cli = Callable[..., Result]


@pytest.fixture
def cli() -> Cli:
    """Call the command line in this process."""
    return call


def recorded(u: np.ndarray, seed: int) -> Recording:
    noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    y = GPI.example().simulate(u) + noise
    return Recording({"pressure": u, "displacement": y}, 0.02)


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A training and a test file."""
    folder = tmp_path_factory.mktemp("recordings")
    time = np.arange(0, 16, 0.02)
    write(recorded(triangle(time, 4.0, [5.0, 4.0, 3.0, 2.0]), 0), folder / "train.csv")
    write(recorded(irregular_triangle(time, 9, 5.0, seed=3), 1), folder / "test.csv")
    return folder / "train.csv", folder / "test.csv"

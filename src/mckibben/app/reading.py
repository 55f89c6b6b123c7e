"""Reading what was uploaded: large files in a process of their own, whose memory goes with it."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mckibben.errors import DataError
from mckibben.files import read
from mckibben.recording import Recording
from mckibben.system.workers import Tell, Workers

LARGE = 16 * 2**20
"""Bytes of a file beyond which it is worth starting a process for."""

MOST_MEMORY = 4 * 2**30
"""Bytes that such a process may address."""

MOST_CELLS = 40_000_000
"""Samples times channels of all recordings of a file."""

Options = Mapping[str, Any]


def read_upload(path: Path, options: Options) -> list[Recording]:
    """Return the recordings of a file.

    Raises
    ------
    DataError
        If it cannot be read, or holds or takes more than is kept in memory here.
    """
    if path.stat().st_size <= LARGE:
        return _read(path, options)
    with Workers(1) as workers:
        (outcome,) = workers.results(_bounded, [(path, options)])
        found: list[Recording] = outcome.result()
    return found


def _bounded(_: object, item: tuple[Path, Options], tell: Tell) -> list[Recording]:
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    return _read(*item)


def _read(path: Path, options: Options) -> list[Recording]:
    found = read(path, informative=False, **options)
    if sum(len(one) * len(one.channels) for one in found) > MOST_CELLS:
        raise DataError(
            f"it holds more than {MOST_CELLS:,} numbers",
            file=path,
            remedy="cut or thin it, or use the command line",
        )
    return found

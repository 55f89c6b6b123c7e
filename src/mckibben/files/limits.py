"""What reading one recording's file may cost, looked at before anything is allocated.

A compressed file can declare more samples than memory holds: a kilobyte of HDF5 holds gigabytes of
zeros. So samples are counted from what the file says about itself; beyond some millions, they must
also be paid for in bytes of the file.
"""

from __future__ import annotations

import os
from io import BufferedReader
from pathlib import Path

from mckibben.errors import DataError, TooLargeError

MOST_BYTES = 2**30
"""Bytes that a file may have: ten channels of ten million samples, 8 bytes each, and some more."""

MOST_SAMPLES = 100_000_000
"""Samples over all columns (0.8 GB of memory)."""

FREE_SAMPLES = 10_000_000
"""Samples over all columns that may be packed as closely as a format can."""

PER_BYTE = 4
"""Samples for each byte of the file beyond that; measured ones, with their noise, have about one."""

MOST_PARTS = 10_000
"""Columns, groups, segments and the like of which a file may be made."""

MOST_PIECES = 500_000
"""Stretches in which the samples of the columns lie scattered over a file, one read for each."""

MOST_TEXT = 2**16
"""Characters of a text about the recording, such as a unit; longer ones are left out."""


class Budget:
    """What is left of what one file may hold.

    Parameters
    ----------
    file : binary file
        It counts by its size, and stays where it stands.
    path : path
        The name to give in errors.
    """

    def __init__(self, file: BufferedReader, path: Path) -> None:
        self._path = path
        paid = PER_BYTE * os.fstat(file.fileno()).st_size
        self.allowed = min(MOST_SAMPLES, max(FREE_SAMPLES, paid))
        self._samples = 0
        self._parts = 0
        self._pieces = 0

    def samples(self, more: int) -> None:
        """Count samples that are about to be read; `DataError` if they are too many."""
        self._samples += more
        self.at_once(self._samples)

    def at_once(self, samples: int) -> None:
        """Refuse what unpacks to that many samples at once, which are not kept."""
        if samples > MOST_SAMPLES:
            raise TooLargeError(
                f"it declares {samples} samples, more than the {MOST_SAMPLES} that are read at once",
                file=self._path,
                remedy="split the file, or check that it is not damaged",
            )
        if samples > self.allowed:
            raise DataError(
                f"it declares {samples} samples, packed so closely that none were measured",
                file=self._path,
                remedy="save it without compression if it is what it should be",
            )

    def parts(self, more: int) -> None:
        """Count parts that are about to be looked at; `DataError` if they are too many."""
        self._parts += more
        if self._parts > MOST_PARTS:
            raise DataError(
                f"it is made of more than {MOST_PARTS} parts",
                file=self._path,
                remedy="save each channel as one vector, in one piece",
            )

    def pieces(self, more: int) -> None:
        """Count stretches of samples that are about to be read; `DataError` if too many."""
        self._pieces += more
        if self._pieces > MOST_PIECES:
            raise DataError(
                f"its samples lie scattered in more than {MOST_PIECES} places",
                file=self._path,
                remedy="defragment the file, or save each channel in one piece",
            )

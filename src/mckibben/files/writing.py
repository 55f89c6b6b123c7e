"""Writing recordings, so that reading them gives the same recording to the last bit."""

from __future__ import annotations

from pathlib import Path

from mckibben.files.formats import writer
from mckibben.recording import Recording


def write(recording: Recording, path: str | Path) -> None:
    """Write a recording to a file, which `read` turns into an equal one.

    What had that name before is replaced: the command line asks first, a function does as it is told.

    Parameters
    ----------
    recording : Recording
    path : path
        Ends in ``.csv``, ``.tsv`` or ``.parquet``. Text files have a plain header of channel
        names, ``time`` [s] first where the recording has time, and a sidecar
        ``NAME.csv-metadata.json`` with units, time grid and meta beside them.

    Raises
    ------
    DataError
        If the ending is another, the folder cannot be written to, a channel is named ``time``, or
        ``meta`` holds what JSON cannot. What was in the file before is then still there.
    """
    path = Path(path)
    writer(path).write(recording, path)

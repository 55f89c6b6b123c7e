"""Folders of recordings, and what each recording in them is for."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

from mckibben.errors import DataError
from mckibben.files.sources import PROTOCOL, inside
from mckibben.system.ordinary import DESCRIPTION, read_text


def roles(folder: Path) -> dict[str, list[Path]]:
    """Return the recordings of a folder by role, as its protocol.json has them, or all to train.

    A folder that is one recording itself, as of files with one signal each, stands for that.

    Raises
    ------
    DataError
        If there are none, or it cannot be told which files are one.
    """
    protocol = folder / PROTOCOL
    found = inside(folder)
    if not os.path.lexists(protocol):
        return {"train": found}
    text = read_text(protocol, most=DESCRIPTION)
    try:
        given = {str(run["name"]): str(run["role"]) for run in json.loads(text)["runs"]}
    except (ValueError, KeyError, TypeError, RecursionError):
        raise DataError(
            "its protocol.json is not readable", file=folder, remedy="repair or remove it"
        ) from None
    by_role: dict[str, list[Path]] = {}
    for path in found:
        by_role.setdefault(given.get(path.stem, "train"), []).append(path)
    return by_role


def expanded(
    files: Sequence[Path], test: Sequence[Path]
) -> tuple[list[Path], list[Path], list[Path]]:
    """Return files to train, to validate and to test on, folders replaced by what is in them.

    Parameters
    ----------
    files : sequence of Path
        Files to train on; of folders, each recording has its own role.
    test : sequence of Path
        Files to test on; of folders, everything.

    Raises
    ------
    DataError
        On a folder without recordings.
    """
    found: dict[str, list[Path]] = {"train": [], "validation": [], "test": []}
    for file in files:
        for role, paths in (roles(file) if file.is_dir() else {"train": [file]}).items():
            found.setdefault(role, []).extend(paths)
    for file in test:
        inside = roles(file).values() if file.is_dir() else [[file]]
        found["test"] += [path for paths in inside for path in paths]
    return found["train"], found["validation"], found["test"]

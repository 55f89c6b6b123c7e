"""Commands called in this process."""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from mckibben.cli.main import run


@dataclass(frozen=True)
class Result:
    """What a command left behind."""

    code: int
    out: str
    err: str


def call(*words: object, folder: Path | None = None) -> Result:
    """Call the command line, in a folder if one is given."""
    out, err = io.StringIO(), io.StringIO()
    arguments = ["mckibben", *map(str, words)]
    with (
        _inside(folder),
        patch.object(sys, "argv", arguments),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            run()
            code = 0
        except SystemExit as leaving:
            code = int(leaving.code or 0)
    return Result(code, out.getvalue(), err.getvalue())


def answered(*words: object, folder: Path | None = None) -> Any:
    """Return the JSON that a command prints; refuse one that fails."""
    result = call(*words, "--json", folder=folder)
    if result.code != 0:
        raise RuntimeError(f"{' '.join(map(str, words))}: {result.code} {result.err}")
    return json.loads(result.out)


@contextmanager
def _inside(folder: Path | None) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder or before)
    try:
        yield
    finally:
        os.chdir(before)

"""The command line, called in this process."""

from __future__ import annotations

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from unittest.mock import patch

from mckibben.cli.main import run


@dataclass
class Result:
    """What a command left behind."""

    code: int
    out: str
    err: str


def call(*words: object) -> Result:
    """Call the command line."""
    out, err = io.StringIO(), io.StringIO()
    arguments = ["mckibben", *map(str, words)]
    with patch.object(sys, "argv", arguments), redirect_stdout(out), redirect_stderr(err):
        try:
            run()
            code = 0
        except SystemExit as leaving:
            code = int(leaving.code or 0)
    return Result(code, out.getvalue(), err.getvalue())

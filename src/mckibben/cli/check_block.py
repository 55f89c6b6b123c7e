"""mckibben check-block: what a block of one's own still lacks."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.options import Json
from mckibben.cli.output import print_json, say

INCOMPLETE = 3
"""Exit code."""


def check_block(
    block: Annotated[
        str, typer.Argument(help="Kind of a block, or package.module:Class, which is imported.")
    ],
    as_json: Json = False,
) -> None:
    """Say all that a block lacks: registry line, laws, inverse, C, estimator, tests and so on."""
    from dataclasses import asdict

    from mckibben.missing import missing

    sys.path.append(
        str(Path.cwd())
    )  # behind all else, so that no file here stands before a library
    found = missing(block)
    if as_json:
        print_json([asdict(finding) for finding in found])
    else:
        for finding in found:
            say(
                f"{finding.state:<8} {finding.what}" + (f": {finding.said}" if finding.said else "")
            )
    absent = [finding.what for finding in found if finding.state == "missing"]
    if absent:
        say(f"Missing: {', '.join(absent)}", error=True)
        raise typer.Exit(INCOMPLETE)

"""What is wrong, in the words of the workbench: fields and buttons where a terminal has options."""

from __future__ import annotations

import re

from mckibben.errors import DataError

LONGEST = 2000
"""Characters of a message that are shown."""

GAPS = {"error": "refuse", "split": "split there", "interpolate": "bridge by straight lines"}
"""What is done about gaps, in words."""

_FIELDS = (
    (r"--gaps split or (--gaps )?interpolate", f"“{GAPS['split']}” or “{GAPS['interpolate']}”"),
    (r"--gaps interpolate or split", f"“{GAPS['interpolate']}” or “{GAPS['split']}”"),
    (r"--gaps split", f"“{GAPS['split']}”"),
    (r"--gaps interpolate", f"“{GAPS['interpolate']}”"),
    (r"--column (\w+)=('[^']*'|\S+\b)", r"the field Channel (\1)"),
    (r"--unit (\w+)=(\S+\b)", r"the field Unit (\2, say, of \1)"),
    (r"--unit\b", "the field Unit"),
    (r"--rate\b", "samples per second"),
)
"""Options of the command line, and the fields that stand for them."""


def said(error: Exception | str) -> str:
    """Return what is wrong, a file's folder aside, with fields instead of options."""
    text = str(error)
    if isinstance(error, DataError):
        text = text.replace(f"{error.file}, ", "").replace(f"{error.file}: ", "")
    for option, field in _FIELDS:
        text = re.sub(option, field, text)
    return text[:LONGEST].encode("utf-8", "replace").decode()


def shortened(text: str, most: int) -> str:
    """Return a text without its middle where it is long: what tells names apart is often at the end.

    >>> shortened("balance-force-muscle12cm_contracted10mm_2", 21)
    'balance-fo…cted10mm_2'
    """
    half = (most - 1) // 2
    return text if len(text) <= most else f"{text[:half]}…{text[half + 1 - most :]}"

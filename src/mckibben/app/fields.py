"""What is wrong, in the words of the workbench: fields and buttons where a terminal has options."""

from __future__ import annotations

import re

from mckibben.errors import DataError

LONGEST = 2000
"""Characters of a message that are shown."""

GAPS = {
    "error": "refuse",
    "split": "split there",
    "interpolate": "bridge by straight lines",
}
"""What is done about gaps, in words."""

RAW = "Codes for missing samples, and wraps, as measured"

READING = "How it was read"
"""What stands on the button that opens the dialog on a file."""

_WAYS = (
    (r"--gaps split or (--gaps )?interpolate", f"“{GAPS['split']}” or “{GAPS['interpolate']}”"),
    (r"--gaps interpolate or split", f"“{GAPS['interpolate']}” or “{GAPS['split']}”"),
    (r"--gaps split", f"“{GAPS['split']}”"),
    (r"--gaps interpolate", f"“{GAPS['interpolate']}”"),
    (r"--raw", f"“{RAW}”"),
    (r"say --unit CHANNEL=UNIT", f"give units by “{READING}”"),
    (r"say --unit (\w+)=UNIT", rf"give the unit of \1 by “{READING}”"),
    (r"--unit (\w+)=UNIT", r"the field Unit of \1"),
    (r"--unit (\w+)=(\S+\b)", r"the field Unit (\2, say, of \1)"),
    (r"say --column CHANNEL=COLUMN", "change the field Channel"),
    (r"--column CHANNEL=COLUMN", "the field Channel"),
    (r"--column (\w+)=('[^']*'|\S+\b)", r"the field Channel (\1)"),
    (r" \([^()]*--[a-z][^()]*(\([^()]*\)[^()]*)?\)", ""),  # what is to be done is said before
    (r"--minutes (\d[\d.]*)", r"\1 minutes"),
    (r"--(sample-time|resample) (SECONDS|\d[\d.]*)", "the field of the sample time"),
    (r"--limits? (\w+)=\S+:[^\s.,]+", r"limits of \1"),
    (r"--load (\w+)", r"\1 among the inputs"),
    (r"--zero (\w+) (?:\(|and )mckibben\.signals\.zeroed\)?", r"“Zero \1 there”, under Data"),
    (r"--zero (\w+)", r"the button that zeroes \1"),
    (r"--set ", "the setting "),
    (
        r"give a path in a folder that can be written to, on a disk that is not full",
        "make room on the disk, or see to the rights of the folder",
    ),
    (r"see mckibben info --models", "see the settings of the models"),
)
"""Options with their values, and what they are on a page."""

_WORDS = {
    "allow-shared": "“Allow the same data in training and test”",
    "check": "the check",
    "column": f"“{READING}”",
    "float32": "“single precision”",
    "force": "“replace”",
    "input": "the field Inputs",
    "inverse": "“its compensator”",
    "jobs": "fewer at a time",
    "limits": "the limits",
    "load": "the load",
    "measured": "the topic measured",
    "minutes": "minutes to record",
    "model": "the model",
    "muscle": "the muscle",
    "name": "name",
    "output": "the field Outputs",
    "overwrite": "replace it",
    "plant": "the plant",
    "rate": f"samples per second (“{READING}”)",
    "resample": "the button “Resample”",
    "rig": "the rig",
    "sample-time": "the time between steps",
    "samples": "the most samples",
    "test": "a test recording",
    "unit": f"the field Unit (“{READING}”)",
}
"""All other options, and what stands for them."""


def said(error: Exception | str) -> str:
    """Return what is wrong, a file's folder aside, with fields instead of options."""
    text = str(error)
    if isinstance(error, DataError):
        text = text.replace(f"{error.file}, ", "").replace(f"{error.file}: ", "")
    for option, field in _WAYS:
        text = re.sub(option, field, text)
    text = re.sub(r"(?<![\w-])--([a-z][a-z0-9-]*)", _word, text)
    return text[:LONGEST].encode("utf-8", "replace").decode()


def _word(option: re.Match[str]) -> str:
    return _WORDS.get(option[1], option[0])


def shortened(text: str, most: int) -> str:
    """Return a text without its middle where it is long: what tells names apart is often at the end.

    >>> shortened("balance-force-muscle12cm_contracted10mm_2", 21)
    'balance-fo…cted10mm_2'
    """
    half = (most - 1) // 2
    return text if len(text) <= most else f"{text[:half]}…{text[half + 1 - most :]}"

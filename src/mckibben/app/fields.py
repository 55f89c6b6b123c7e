"""What is wrong, in the words of the workbench: fields and buttons where a terminal has options."""

from __future__ import annotations

from mckibben.errors import MckibbenError, in_terms_of, rendered

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

_CONTROLS = {
    "allow_shared": "“Allow the same data in training and test”",
    "calibration": f"“{READING}”",
    "check": "the check",
    "columns": "the field Channel",
    "constants": f"“{READING}”",
    "force": "“replace”",
    "input": "the field Inputs",
    "inputs": "the field Inputs",
    "inverse": "“its compensator”",
    "jobs": "fewer at a time",
    "limits": "the limits",
    "load": "the load",
    "minutes": "the minutes to record",
    "model": "the model",
    "most_samples": "the most samples",
    "output": "the field Outputs",
    "outputs": "the field Outputs",
    "rate": f"samples per second (“{READING}”)",
    "raw": f"“{RAW}”",
    "resample": "the button “Resample”",
    "rest_length": f"the rest length (“{READING}”)",
    "sample_time": "the time between steps",
    "settings": "the settings",
    "single": "“single precision”",
    "test": "a test recording",
    "units": f"the field Unit (“{READING}”)",
    "zero": "the button that zeroes it",
}
"""Parameters of operations, and what they are on a page."""


def control(name: str, key: str | None = None, value: str | None = None) -> str:
    """Return a parameter in an error as a control of a page.

    >>> control("gaps", None, "split"), control("units", "force", "N")
    ('“split there”', 'the field Unit (“How it was read”) of force (N)')
    """
    if name == "gaps" and value in GAPS:
        return f"“{GAPS[value]}”"
    shown = _CONTROLS.get(name, name.replace("_", " "))
    of = f" of {key}" if key else ""
    placeholder = value is not None and value.isupper() and len(value) > 1  # such as UNIT, not N
    given = f" ({value})" if value and not placeholder else ""
    return f"{shown}{of}{given}"


def said(error: Exception | str) -> str:
    """Return what is wrong, a file's folder aside, with controls for parameters."""
    if isinstance(error, MckibbenError):
        text = rendered(error, control)
        text = text.replace(f"{error.file}, ", "").replace(f"{error.file}: ", "")
    else:
        text = in_terms_of(str(error), control)
    return text[:LONGEST].encode("utf-8", "replace").decode()


def shortened(text: str, most: int) -> str:
    """Return a text without its middle where it is long: what tells names apart is often at the end.

    >>> shortened("balance-force-muscle12cm_contracted10mm_2", 21)
    'balance-fo…cted10mm_2'
    """
    half = (most - 1) // 2
    return text if len(text) <= most else f"{text[:half]}…{text[half + 1 - most :]}"

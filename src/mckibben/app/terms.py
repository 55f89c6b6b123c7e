"""Errors in the terms of the workbench: controls where a remedy names parameters."""

from __future__ import annotations

from mckibben.errors import MckibbenError, in_terms_of, rendered

GAPS = {
    "error": "Refuse",
    "split": "Split there",
    "interpolate": "Bridge by straight lines",
}
"""What can be done about gaps."""

CONTROLS = {
    "controller": "the field Controllers",
    "allow_shared": "“Allow the same data in training and test”",
    "calibration": "gain and offset",
    "columns": "the field Channel",
    "constants": "a held channel",
    "input": "the field Inputs",
    "inputs": "the field Inputs",
    "output": "the field Outputs",
    "outputs": "the field Outputs",
    "rate": "the field Samples per second",
    "plant": "the field Tried on",
    "raw": "“Codes and counters as measured”",
    "resample": "“Resample”",
    "reference": "the motion",
    "test": "a test recording",
    "units": "the field Unit",
    "zero": "“Zero”",
}
"""Parameters of operations, and the controls that set them."""

FIELDS = ("approach", "encoding", "gaps", "load", "preview", "rest_length", "sample_time", "slew")
"""Those whose control is a field of the same name."""

PLACES = {
    "check": "the tab Check under Models",
    "compare": "“Fit models”",
    "fit": "“Fit models”",
    "invert": "Compensate",
    "plan": "“Plan the next recording” under Look",
    "resample": "“Resample” under Data",
    "study": "“Report” under Take away",
    "track": "“Run” under Compensate",
}
"""Operations, and where they are."""


def place(name: str) -> str:
    """Return an operation as a place of the workbench.

    >>> place("invert"), place("open_it")
    ('Compensate', 'open it')
    """
    return PLACES.get(name, name.replace("_", " "))


def control(name: str, key: str | None = None, value: str | None = None) -> str:
    """Return a parameter as a control of a page.

    >>> control("gaps", None, "split"), control("units", "force", "N")
    ('“Split there”', 'the field Unit of force (N)')
    """
    if name == "gaps" and value in GAPS:
        return f"“{GAPS[value]}”"
    of = f" of {key}" if key and not _placeholder(key) else ""
    given = f" ({value})" if value and not _placeholder(value) else ""
    words = name.replace("_", " ")
    field = f"the field {words.capitalize()}" if name in FIELDS else words
    return f"{CONTROLS.get(name, field)}{of}{given}"


def _placeholder(word: str) -> bool:
    """Return whether a word is to be replaced, such as UNIT; N is a unit."""
    return word.isupper() and len(word) > 1


def said(error: Exception | str) -> str:
    """Return an error or a note in the terms of the workbench, without the folder of its file.

    >>> said("it is too short")
    'It is too short'
    """
    if isinstance(error, MckibbenError):
        text = rendered(error, control, place)
        if error.file is not None:
            text = text.replace(f"{error.file}", error.file.name)
    else:
        text = in_terms_of(str(error), control, place)
    if text.partition(" ")[0].isalpha():  # a word, not the name of a file or channel
        text = text[:1].upper() + text[1:]
    return text[:2000]

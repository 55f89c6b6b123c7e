"""Errors in the terms of the workbench: controls where a remedy names parameters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from mckibben.errors import MckibbenError, argument_words, in_terms_of, rendered

GAPS = {
    "error": "Refuse",
    "split": "Split there",
    "interpolate": "Bridge by straight lines",
}
"""Labels of the ways to treat gaps."""

LABELS = {
    "constants": "Constant quantities",
    "header": "Header in line",
    "join": "Join the pieces in the file",
    "plant": "Tried on",
    "rate": "Samples per second",
    "raw": "Codes and counters as measured",
    "skip": "Lines after it left out",
}
"""Labels of fields that are not their name in words."""

CONTROLS = {
    "controller": "the field Controllers",
    "allow_shared": "“Allow the same data in training and test”",
    "calibration": "gain and offset",
    "columns": "the field Channel",
    "input": "the field Inputs",
    "inputs": "the field Inputs",
    "output": "the field Outputs",
    "outputs": "the field Outputs",
    "resample": "“Resample”",
    "reference": "the motion",
    "test": "a test recording",
    "units": "the field Unit",
    "zero": "“Zero”",
}
"""Parameters of operations, and the controls that set them."""

FIELDS = (
    *("approach", "encoding", "gaps", "load", "preview", "rest_length", "sample_time", "sheet"),
    *("slew", *LABELS),
)
"""Parameters whose control is a field with its label."""

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
"""Operations, and where they are in the workbench."""


def place(name: str) -> str:
    """Return where an operation is in the workbench.

    >>> place("invert"), place("open_it")
    ('Compensate', 'open it')
    """
    return PLACES.get(name, name.replace("_", " "))


def control(name: str, key: str | None = None, value: str | None = None) -> str:
    """Return the control that sets a parameter.

    >>> control("gaps", None, "split"), control("units", "force", "N")
    ('“Split there”', 'the field Unit of force (N)')
    """
    if name == "gaps" and value in GAPS:
        return f"“{GAPS[value]}”"
    words = name.replace("_", " ")
    default = f"the field {LABELS.get(name, words.capitalize())}" if name in FIELDS else words
    of_key = f" of {key}" if key and not _is_placeholder(key) else ""
    example = f" ({value})" if value and not _is_placeholder(value) else ""
    return f"{CONTROLS.get(name, default)}{of_key}{example}"


def choice(options: Mapping[str, Any]) -> str:
    """Return options as the label of a button.

    >>> choice({"units": {"force": "N"}}), choice({"gaps": "split"})
    ('Unit of force (N)', 'Split there')
    """
    words = in_terms_of(argument_words(options), control, place)
    return message_of(re.sub("the field |[“”]", "", words))


def _is_placeholder(word: str) -> bool:
    """Return whether a word is to be replaced, such as UNIT; N is a unit."""
    return word.isupper() and len(word) > 1


def message_of(error: Exception | str) -> str:
    """Return an error or a note in the terms of the workbench, without the folder of its file.

    >>> message_of("it is too short")
    'It is too short'
    """
    if isinstance(error, MckibbenError):
        text = rendered(error, control, place)
        if error.file is not None:
            text = text.replace(str(error.file), error.file.name)
    else:
        text = in_terms_of(str(error), control, place)
    if text.partition(" ")[0].isalpha():  # a word, not the name of a file or channel
        text = text[:1].upper() + text[1:]
    return text[:2000]

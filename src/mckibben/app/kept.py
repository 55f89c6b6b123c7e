"""What is read of a workspace: checked here, so that what is damaged costs its line and never a page."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import from_json

LONGEST = 10_000
"""Characters of a text."""


def _finite(value: Any) -> float | None:
    """Return a number, or None for what is none: NaN and Infinity stand in files of good fits too."""
    if value is None or isinstance(value, bool) or not isinstance(value, int | float):
        if value is None:
            return None
        raise ValueError("no number")
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:
        return None


Text = Annotated[str, Field(max_length=LONGEST)]
Number = Annotated[float | None, BeforeValidator(_finite)]
Error = Annotated[Annotated[float, Field(ge=0)] | None, BeforeValidator(_finite)]
Count = Annotated[int, Field(ge=0, le=2**53)]


class Kept(BaseModel):
    """Anything kept; what is not known of it is passed over."""

    model_config = ConfigDict(extra="ignore", strict=True)


class Line(Kept):
    """A line of the log."""

    did: Text
    call: Text = ""
    time: Text = ""


class Reading(Kept):
    """How a file is read: what `mckibben.read` takes, but for ``channels``.

    Of those that are not named, columns are left out; None is all that there are.
    """

    columns: dict[Text, Text] = {}
    units: dict[Text, Text] = {}
    calibration: dict[Text, tuple[float, float]] = {}
    constants: dict[Text, tuple[float, Text]] = {}
    rate: Number = None
    gaps: Literal["error", "split", "interpolate"] = "error"
    raw: bool = False
    channels: list[Text] | None = None

    model_config = ConfigDict(extra="ignore", strict=False)  # JSON has lists for pairs


class Step(Kept):
    """What was done to a recording after it was read; see `mckibben.app.edits`."""

    do: Literal["slice", "low_pass", "detrend", "resample", "zero"]
    start: Count = 0
    stop: Count = 0
    cutoff: Number = None
    sample_time: Number = None
    over: Text | None = None
    channels: list[Text] | None = None


class Described(Kept):
    """What is known of a recording: its role, its file, and the way from what was read to that."""

    role: Literal["train", "test", "unused"]
    origin: Text = ""
    call: Text = ""
    file: Text = ""
    notes: list[Text] = []
    base: Text = ""
    upload: Text = ""
    part: Count = 0
    reading: Reading | None = None
    steps: list[Step] = []


class Change(Kept):
    """What was changed of recordings: their descriptions before and after, None where there is none."""

    what: Text
    before: dict[Text, dict[str, Any] | None]
    after: dict[Text, dict[str, Any] | None]


class History(Kept):
    """Changes that can be undone, oldest first, and those that were undone."""

    done: list[Change] = []
    undone: list[Change] = []


class Figures(Kept):
    """How a model did on some recordings."""

    rmse: Error = None
    r2: Number = None
    max_error: Error = None
    rmse_interval: list[Error] | None = Field(default=None, min_length=2, max_length=2)


class Memory(Kept):
    """Whether a model keeps its branches apart."""

    gap_ratio: Number = None
    hold_ratio: Number = None


class Constant(Kept):
    """How far off the mean of the training output is, which every model has to beat."""

    validation_rmse: Error = None
    test: Figures | None = None


class Said(Kept):
    """Figures of which the words are shown; of results kept by older versions there are none."""

    said: Text = ""


class Fitted(Kept):
    """What came of a fit."""

    status: Literal["ok"]
    model: Text = ""
    input: Text = ""
    output: Text = ""
    load: Text = ""
    unit: Text = ""
    split: Text = ""
    chosen_by: Literal["cross-validation", "validation", "given", "fit"] = "cross-validation"
    settings: dict[str, Any] = {}
    validation_rmse: Error = None
    validation_failed: Text | None = None
    test: Figures | None = None
    train: Figures | None = None
    memory: Memory | None = None
    band: Said | None = None
    outputs: dict[Text, Figures] = {}
    n_parameters: Count | None = None
    fit_seconds: Number = None
    step_ns: Number = None
    constant: Constant | None = None
    skill_least: Number = None
    inverse: Literal["exact", "solved", "none"] | None = None
    not_recommended: Text | None = None
    shared: list[Text] = []
    data: Text = ""


class Followed(Kept):
    """What came of a closed loop."""

    model: Text
    rig: Text = ""
    plant: Text = ""
    controller: Text = ""
    form: Text = "inverse"
    reference: Text = ""
    rmse: dict[str, Number] = {}
    largest: dict[str, Number] = {}
    offset: dict[str, Number] = {}
    scatter: dict[str, Number] = {}
    uncompensated: dict[str, Number] = {}
    units: dict[str, Text] = {}
    held: dict[str, Number] = {}
    notes: list[Text] = []
    clipped: Count | None = None
    step_us: Number = None


class Line2D(Kept):
    """A curve to draw: its name, colour, and whether it stands below."""

    name: Text
    colour: Text = "series-1"
    below: bool = False
    x: list[Number] = []
    y: list[Number] = []


class Cause(Kept):
    """What a part of an error comes from."""

    kind: Text
    share: Number = None
    said: Text = ""


class Reviewed(Kept):
    """What a log of the real rig said of one output."""

    log: Text
    model: Text
    form: Text = "inverse"
    output: Text
    unit: Text = ""
    achieved: Number = None
    predicted: Number = None
    causes: list[Cause] = []
    verdict: Text = ""
    sentences: list[Text] = []
    refitted: bool = False
    curves: list[Line2D] = []


class Estimated(Kept):
    """What an estimate of force was beside the measured one."""

    model: Text
    recording: Text
    output: Text
    unit: Text = ""
    rmse: Number = None
    largest: Number = None
    span: Number = None
    notes: list[Text] = []
    curves: list[Line2D] = []


class Given(Kept):
    """What a job is to do, as far as the page shows it; the rest is for the work to judge."""

    model_config = ConfigDict(extra="allow", strict=True)
    title: Text = ""
    name: Text = ""
    model: Text = ""
    call: Text = ""
    settings: dict[str, Any] = {}


class Noted(Kept):
    """What a job is and how it went."""

    kind: Literal["check", "fit", "force", "loop", "plan", "record", "report", "review"]
    state: Text
    message: Text = ""
    given: Given


Any_ = TypeVar("Any_", bound=Kept)


def checked(kind: type[Any_], content: Any) -> Any_ | None:
    """Return what was kept, or None where it is not what it should be."""
    try:
        return kind.model_validate(content)
    except ValidationError:
        return None


def parsed(content: bytes) -> Any:
    """Return what JSON holds, or None where it is damaged: not UTF-8, half there, endlessly deep."""
    try:
        return from_json(content)
    except ValueError:
        return None


def lines(content: bytes) -> Iterable[Line]:
    """Yield the lines of a log that are whole."""
    for line in content.split(b"\n"):
        found = checked(Line, parsed(line)) if line.strip() else None
        if found is not None:
            yield found


def progress(content: bytes) -> list[tuple[float, float, float]]:
    """Return what a job told, as far as it is whole: seconds, share done, least cost so far or NaN."""
    told = []
    for line in content.splitlines():
        try:
            seconds, share, cost = map(float, line.split())
        except ValueError:
            continue
        if math.isfinite(seconds) and 0.0 <= share <= 1.0:
            told.append((seconds, share, cost))
    return told

"""Keyword arguments of operations: the fields of their options, and of reading.

Made from `mckibben.options` by ``python -m docs.making.keywords``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict


class ReadKeywords(TypedDict, total=False):
    """Of `mckibben.options.ReadOptions`."""

    columns: Mapping[str, str]
    units: Mapping[str, str]
    constants: Mapping[str, tuple[float, str]]
    calibration: Mapping[str, tuple[float, float] | tuple[str, float, float, str]]
    rate: float | None
    sample_time: float | None
    gaps: Literal["error", "split", "interpolate"]
    raw: bool
    rest_length: float | None
    header: int
    skip: int
    encoding: str | None
    join: bool
    sheet: str | None
    between: tuple[float | None, float | None] | None
    resample: float | None
    zero: Sequence[str]


class ChannelKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.ChannelOptions`."""

    input: str | Sequence[str] | None
    output: str | Sequence[str] | None


class FitKeywords(ChannelKeywords, total=False):
    """Of `mckibben.options.FitOptions`."""

    prior: Any
    residual_of: Any
    target: Literal["mjcf"] | None
    settings: Mapping[str, Any]
    seed: int


class CharacterizeKeywords(ChannelKeywords, total=False):
    """Of `mckibben.options.CharacterizeOptions`."""

    scheduling: Sequence[str]


class CompareKeywords(ChannelKeywords, total=False):
    """Of `mckibben.options.CompareOptions`."""

    load: str | None
    models: str | Sequence[str] | Mapping[str, Any]
    settings: Mapping[str, Any]
    seed: int
    jobs: int | None
    most_samples: int | None
    allow_shared: bool
    quick: bool


class StudyKeywords(CompareKeywords, total=False):
    """Of `mckibben.options.StudyOptions`."""

    rig: Any
    compensator: Any
    model: Any
    title: str


class TrackKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.TrackOptions`."""

    rig: Any
    plant: Any
    limits: Mapping[str, tuple[float | None, ...]]
    controller: str
    repetitions: int
    approach: float
    settle: float
    noise: float
    delay: int
    slew: float | None
    preview: float | None
    pressure_loop: bool
    controller_out: str | Path | None
    fields: Mapping[str, Any]
    seed: int


class LearnKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.LearnOptions`."""

    ahead: int
    repeats: bool
    best: bool


class SimulateKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.SimulateOptions`."""

    initial: Literal["measured", "first_sample", "virgin"]
    interval: float | None
    fields: Mapping[str, Any]


class CalibrateKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.CalibrateOptions`."""

    exchangeable: Literal["auto", "run", "block"]
    fitted: Any


class ReviewKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.ReviewOptions`."""

    model: Any
    compensator: Any
    refit: bool
    seed: int


class PlotKeywords(ChannelKeywords, total=False):
    """Of `mckibben.options.PlotOptions`."""

    model: Any
    kind: str | None
    width: Literal[1, 2] | None


class ReproduceKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.ReproduceOptions`."""

    quick: bool
    rig: Any
    seed: int
    jobs: int | None


class InvertKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.InvertOptions`."""

    wanted: Literal["input", "force"]
    adaptive: bool
    time: float | None
    noise: float | None
    predictive: bool
    horizon: int | None
    rate_limit: float | None
    pressures: tuple[float, float] | None
    learned: Sequence[str | Path]
    fields: Mapping[str, Any]
    seed: int


class PlanKeywords(ReadKeywords, total=False):
    """Of `mckibben.options.PlanOptions`."""

    rig: Any
    minutes: float
    limits: Mapping[str, tuple[float | None, ...]]
    seed: int


class ExportKeywords(TypedDict, total=False):
    """Of `mckibben.options.ExportOptions`."""

    name: str | None
    sample_time: float | None
    inverse: bool
    fields: Mapping[str, Any]
    force: bool


class CKeywords(ExportKeywords, total=False):
    """Of `mckibben.options.COptions`."""

    single: bool
    check: bool
    emulate: bool
    link: bool
    limits: Mapping[str, tuple[float, float]]
    safe: Mapping[str, float]
    watchdog: float | None


class MJCFKeywords(TypedDict, total=False):
    """Of `mckibben.options.MJCFOptions`."""

    rest_length: float | None
    site_from: str | None
    site_to: str | None
    example: Literal["hanging", "joint", "arm"]
    lag: float
    name: str | None
    force: bool


class FMUKeywords(ExportKeywords, total=False):
    """Of `mckibben.options.FMUOptions`."""

    library: bool


class AnyExportKeywords(CKeywords, FMUKeywords, MJCFKeywords, total=False):
    """Of any target of `export`."""

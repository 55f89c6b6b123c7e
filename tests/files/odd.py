"""Files as rigs really leave them, drawn by a seed; nothing here knows how files are read.

About half are plain: quantities and units are in the header, time has a unit or is a date, and
nothing is lost; others may be read rightly only with what the rig's person knows.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray
from openpyxl import Workbook
from scipy.io import savemat
from scipy.signal import lfilter

Array = NDArray[np.float64]
Cell = float | str | datetime | None
Row = list[Cell]
T = TypeVar("T")


@dataclass(frozen=True)
class Odd:
    """A written recording and what is true of it.

    Channels are in bar, mm, N and V on the true grid, as precise as the file is, and NaN where lost.
    Facts are units and columns by channel (a column by its header; without headers by its number,
    from 1), time (its column, if any), rate [Hz], gaps (whether something is lost) and plain.
    """

    paths: list[Path]
    channels: dict[str, Array]
    sample_time: float
    facts: dict[str, Any]
    about: str


# Kinds of file: cells between marks, cells between blanks, worksheets, objects, arrays.
GRIDS = {"text", "blanks", "sheet"}
WORDS = GRIDS | {"lines"}
ALL = WORDS | {"matlab", "hdf5"}
SPARSE = ALL - {"blanks"}  # a cell may be of nothing


class Format(NamedTuple):
    kind: str
    suffix: str
    separator: str = ""
    decimal: str = "."
    weight: float = 5


FORMATS = (
    Format("text", ".csv", ",", weight=20), Format("text", ".csv", ";", ",", weight=14),
    Format("text", ".csv", ";"), Format("text", ".csv", "\t"), Format("text", ".csv", "|", weight=3),
    Format("text", ".txt", "\t", weight=8), Format("text", ".txt", "\t", ",", weight=6),
    Format("text", ".dat", "\t", weight=3), Format("blanks", ".dat", " ", weight=6),
    Format("blanks", ".txt", " "), Format("blanks", ".txt", " ", ",", weight=3),
    Format("lines", ".jsonl"), Format("sheet", ".xlsx"), Format("matlab", ".mat"), Format("hdf5", ".h5"),
)  # fmt: skip

UNITS: dict[str, dict[str, float]] = {  # in bar, mm, N and V
    "pressure": {"bar": 1, "kPa": 0.01, "MPa": 10, "psi": 0.06894757, "mbar": 0.001, "mmHg": 0.00133322},
    "displacement": {"mm": 1, "cm": 10, "m": 1000, "in": 25.4},
    "force": {"N": 1, "kgf": 9.80665, "mN": 0.001},
    "voltage": {"V": 1, "mV": 0.001, "kV": 1000},
}  # fmt: skip

COLUMNS = ("time", "date", "sample", "pressure", "displacement", "force", "voltage", "status")
NAMES = {  # by the language of the header, in the order of COLUMNS
    "English": "Time,Elapsed time|Timestamp|Sample|Pressure|Displacement,Stroke|Force|Voltage|Status",
    "abbreviated": "t|ts,t|n,idx|p,P,press|x,disp,pos|F|U,V,volt|st,cmt",
    "German": "Zeit|Zeitstempel|Nr,Messpunkt|Druck,Überdruck|Weg,Hub|Kraft|Spannung|Prüfvermerk",
    "French": "Temps|Horodatage|Échantillon,N°|Pression|Déplacement,Position|Force,Effort|Tension|État",
    "Spanish": "Tiempo|Fecha y hora|Muestra|Presión|Desplazamiento|Fuerza|Tensión,Voltaje|Estado",
    "Japanese": "時間,時刻|日時|番号,サンプル|圧力|変位,位置|力,荷重|電圧|状態,備考",
    "Chinese": "时间|时间戳,时间|序号,样本|压力,气压|位移,位置|力,拉力|电压|状态,备注",
    "numbered": "Time,t|Time|No,Sample|ch|ch|ch|ch|Note",
    "no": "|||||||",
}  # fmt: skip
ASCII = {"English", "abbreviated", "numbered"}
OLD_ENCODINGS = {"Japanese": "cp932", "Chinese": "gb18030"}  # elsewhere cp1252

STYLES = {  # where the unit is, and the kinds of file that can say it so
    "[unit]": ("{} [{}]", ALL - {"matlab"}),
    "(unit)": ("{} ({})", ALL - {"matlab"}),
    "_unit": ("{}_{}", ALL),
    "/unit": ("{}/{}", WORDS),
    " / unit": ("{} / {}", WORDS - {"blanks"}),
    "unit apart": ("{}", GRIDS | {"hdf5"}),  # in a row of its own, or an attribute
    "no unit": ("{}", ALL),
}


class Clock(NamedTuple):  # its cell is of a time and a resolution, both in µs, as all times here
    label: str
    name: str
    unit: str
    cell: Callable[[int, int], Cell]
    origin: int = 0
    wraps: Callable[[int], int] = lambda _: 0  # modulus [µs], from the resolution
    fits: set[str] = ALL


DAY, EPOCH = 86_400_000_000, datetime(1970, 1, 1)
TODAY = 19_800 * DAY + DAY // 3


def _date(us: int, grain: int, t: str = "T") -> str:
    return (EPOCH + timedelta(0, 0, us)).isoformat(t, "seconds" if grain >= 1e6 else "milliseconds")


CLOCKS = (
    Clock("seconds", "time", "s", lambda us, _: us / 1e6),
    Clock("milliseconds", "time", "ms", lambda us, _: us / 1e3, 0, lambda _: 2**16 * 1000),
    Clock("microseconds", "time", "us", lambda us, _: us, 0, lambda _: 2**32),
    Clock("dates", "date", "", _date, TODAY, fits=WORDS),
    Clock("dates, zoned", "date", "", lambda *at: f"{_date(*at)}+09:00", TODAY, fits=WORDS),
    Clock("dates, blank", "date", "", lambda us, g: _date(us, g, " "), TODAY, fits=WORDS - {"blanks"}),
    Clock("dates of sheets", "date", "", lambda t, _: EPOCH + timedelta(0, 0, t), TODAY, fits={"sheet"}),
    Clock("time of day", "time", "", lambda *at: _date(*at)[11:], DAY // 3, lambda _: DAY, WORDS),
    Clock("epoch in s", "date", "s", lambda us, _: us / 1e6, TODAY),
    Clock("epoch in ms", "date", "ms", lambda us, _: us // 1000, TODAY),
    Clock("sample number", "sample", "", lambda us, grain: us // grain, 0, lambda grain: 256 * grain),
    Clock("no clock", "", "", lambda *_: None),
)  # fmt: skip


@dataclass
class Draft:
    """A file before it is written; a damage changes its rows and what remains true."""

    rng: np.random.Generator
    form: Format
    language: str
    style: str
    clock: Clock
    times: list[int]  # [µs]
    grain: int  # resolution of the clock [µs]
    columns: list[Any]  # what they are: a channel, or a name of COLUMNS
    units: list[Any]
    truth: dict[str, Array]
    rows: list[Row]

    def has(self, trait: str) -> bool:
        distinct = self.clock.name != "" and len(set(self.times)) == len(self.times)
        wraps = distinct and self.clock.wraps(self.grain) > 0
        return {"": True, "clock": distinct, "wraps": wraps, "head": self.language != "no"}[trait]

    def pick(self, most: int) -> list[int]:
        """Some rows inside of the file, in order and no two of them neighbours."""
        inner, size = range(3, len(self.rows) - 3, 2), self.rng.integers(1, most + 1)
        return sorted(self.rng.choice(inner, size, replace=False).tolist())


def _one(rng: np.random.Generator, options: Iterable[T], weights: Sequence[float] = ()) -> T:
    every, shares = list(options), np.array(weights) / sum(weights) if weights else None
    return every[int(rng.choice(len(every), p=shares))]


def _lose(draft: Draft, rows: Iterable[int], *words: Cell) -> None:
    channel, word = _one(draft.rng, draft.truth), _one(draft.rng, words)
    for row in rows:
        draft.truth[channel][row] = np.nan
        draft.rows[row][draft.columns.index(channel)] = word


def _edit(draft: Draft, most: int, change: Callable[[Row, Row], list[Row]]) -> None:
    for row in reversed(draft.pick(most)):
        draft.rows[row : row + 2] = change(*draft.rows[row : row + 2])


def _gap(draft: Draft) -> None:
    (first,) = draft.pick(1)
    lost = slice(first, min(first + int(draft.rng.integers(5, 40)), len(draft.rows) - 3))
    del draft.rows[lost]
    for values in draft.truth.values():
        values[lost] = np.nan


def _short(draft: Draft) -> None:
    (row,) = draft.pick(1)
    kept = int(draft.rng.integers(1, len(draft.columns)))
    del draft.rows[row][kept:]
    for channel in draft.columns[kept:]:
        draft.truth[channel][row] = np.nan


def _summary(draft: Draft) -> None:
    means = np.array([row[1:] for row in draft.rows], float).mean(axis=0)
    draft.rows += [[], ["Mean", *means.round(5).tolist()]]


def _wrap(draft: Draft) -> None:
    zero = draft.times[int(len(draft.times) * draft.rng.uniform(0.2, 0.8))]
    for row, time in zip(draft.rows, draft.times, strict=True):
        row[0] = draft.clock.cell((time - zero) % draft.clock.wraps(draft.grain), draft.grain)


def _twin(draft: Draft) -> None:
    place = draft.columns.index(_one(draft.rng, draft.truth))
    for line in (draft.columns, draft.units, *draft.rows):
        line.append(line[place])


def _remark(draft: Draft) -> None:
    words = np.where(np.gradient(draft.truth["pressure"]) > 0, "filling", "venting").tolist()
    lines = draft.columns, draft.units, *draft.rows
    for line, cell in zip(lines, ["status", "", *words], strict=True):
        line.append(cell)


# Damages with the kinds of file that can have them, and what they need; those of plain files first.
DAMAGES: dict[str, tuple[Callable[[Draft], None], set[str], str]] = {
    "no damage": (lambda _: None, ALL, ""),
    "unrelated text column": (_remark, WORDS, ""),
    "trailing summary": (_summary, GRIDS, "clock"),
    "blank cells": (lambda d: _lose(d, d.pick(8), None), SPARSE, ""),
    "NaN words": (lambda d: _lose(d, d.pick(8), "NaN", "nan", "N/A", "null", "#N/A", "---"), WORDS, ""),
    "code -9999": (lambda d: _lose(d, d.pick(8), -9999), ALL, ""),
    "text in a cell": (lambda d: _lose(d, d.pick(1), "ERR", "overload", "?"), WORDS, ""),
    "late channel": (lambda d: _lose(d, range(d.rng.integers(5, 60)), None), SPARSE, ""),
    "slow channel": (lambda d: _lose(d, [i for i in range(len(d.rows)) if i % 5], None), SPARSE, ""),
    "gap in time": (_gap, ALL, "clock"),
    "repeated rows": (lambda d: _edit(d, 3, lambda a, b: [a, a, b]), ALL, "clock"),
    "rows swapped": (lambda d: _edit(d, 3, lambda a, b: [b, a]), ALL, "clock"),
    "short row": (_short, WORDS, ""),
    "junk line": (lambda d: _edit(d, 1, lambda a, b: [a, ["*** restart ***"], b]), GRIDS, ""),
    "blank line": (lambda d: _edit(d, 1, lambda a, b: [a, [""], b]), GRIDS, ""),
    "wrapped counter": (_wrap, ALL, "wraps"),
    "two columns of one header": (_twin, GRIDS, "head"),
}  # fmt: skip


def _muscle(rng: np.random.Generator, units: dict[str, str]) -> dict[str, Array]:
    """Cycles of a muscle whose length lags its pressure, as they are in the file."""
    k = np.arange(rng.integers(200, 601))
    fading = np.linspace(1, rng.uniform(0.5, 1), k.size)
    p = 3 * (1 - np.cos(2 * np.pi * k / rng.uniform(70, 160))) * fading
    x = 4 * p + 2.6 * lfilter([0.1], [1, -0.9], p)
    volts = p * (1000 if units.get("voltage") == "kV" else 10 / 6)  # of an amplifier, or a valve
    exact = {"pressure": p, "displacement": x, "force": 34 * p * (1 - x / 80), "voltage": volts}
    shown = {c: exact[c] + rng.normal(0, 1e-3 * exact[c].max(), k.size) for c in units}
    shown = {c: values / UNITS[c][units[c]] for c, values in shown.items()}
    return {c: v.round(5 - int(np.floor(np.log10(v.max())))) for c, v in shown.items()}


def _draft(rng: np.random.Generator, plain: bool) -> tuple[Draft, int]:
    """Draw a file without damage, and its period in microseconds."""
    form = _one(rng, FORMATS, [each.weight for each in FORMATS])
    names = {n for n in list(NAMES)[: -2 if plain else None] if form.kind != "matlab" or n in ASCII}
    names -= {"Japanese", "Chinese"} if form.decimal == "," else set()
    language = _one(rng, sorted(names if form.kind in GRIDS else names - {"no"}))
    styles = [s for s in list(STYLES)[: -1 if plain else None] if form.kind in STYLES[s][1]]
    style = "no unit" if language == "no" else _one(rng, styles)
    clock = _one(rng, [c for c in CLOCKS[: -2 if plain else None] if form.kind in c.fits])
    period = 1_000_000 // _one(rng, (10, 20, 50, 100, 200, 250, 500, 1000))
    coarse = 1 if plain or rng.random() < 0.8 else 10 ** len(str(2 * period - 1))
    grain = period if clock.name == "sample" else coarse
    more = [channel for channel in ("force", "voltage") if rng.random() < 0.4]
    channels = rng.permutation(["pressure", "displacement", *more]).tolist()
    units = {channel: _one(rng, UNITS[channel]) for channel in channels}
    shown = _muscle(rng, units)
    truth = {channel: values * UNITS[channel][units[channel]] for channel, values in shown.items()}
    late = rng.integers(period // 10, size=len(shown["pressure"])) * _one(rng, (0, 0, 1))
    start = clock.origin + period * _one(rng, (0, int(rng.integers(5000))))
    times = [int(t - t % grain) for t in start + period * np.arange(late.size) + late]
    table = {clock.name: [clock.cell(time, grain) for time in times]} if clock.name else {}
    table |= {channel: values.tolist() for channel, values in shown.items()}
    rows = [list(row) for row in zip(*table.values(), strict=True)]
    heads = list(table), [units.get(column, clock.unit) for column in table]
    return Draft(rng, form, language, style, clock, times, grain, *heads, truth, rows), period


def _header(draft: Draft) -> list[str]:
    """Headers of columns with their units, as the kind of file permits."""
    words = dict(zip(COLUMNS, NAMES[draft.language].split("|"), strict=True))
    names = {c: _one(draft.rng, words[c].split(",")) for c in dict.fromkeys(draft.columns)}
    names = {c: f"ch{i}" if name == "ch" else name for i, (c, name) in enumerate(names.items(), 1)}
    style, each = STYLES[draft.style][0], zip(draft.columns, draft.units, strict=True)
    heads = [style.format(names[c], unit) if unit else names[c] for c, unit in each]
    if draft.form.kind in ("blanks", "matlab"):
        heads = [h.replace(" [", "[").replace(" (", "(").replace(" ", "_") for h in heads]
    return heads


def _write(draft: Draft, path: Path, head: list[str], encoding: str) -> None:
    form, apart = draft.form, draft.style == "unit apart"
    units: Row = [unit or "-" * (form.kind == "blanks") for unit in draft.units]
    rows: list[Row] = [list[Cell](head)] * bool(head) + [units] * apart + draft.rows
    end, within = _one(draft.rng, (("\n", "run1/"), ("\r\n", "")))
    if form.kind in ("text", "blanks"):
        cells = [["" if c is None else str(c).replace(".", form.decimal) for c in r] for r in rows]
        width = 10 if form.suffix == ".dat" else 0
        lines = [form.separator.join(cell.rjust(width) for cell in row) for row in cells]
        path.write_bytes(end.join([*lines, ""]).encode(encoding))
    elif form.kind == "lines":
        objects = [dict(zip(head, row, strict=False)) for row in draft.rows]
        path.write_text("\n".join(json.dumps(o, ensure_ascii=False) for o in objects), encoding)
    elif form.kind == "sheet":
        book = Workbook(write_only=True)
        sheet = book.create_sheet("data")
        for row in rows:
            sheet.append(row)
        book.save(path)
    elif form.kind == "matlab":
        arrays = dict(zip(head, np.array(draft.rows, float).T, strict=True))
        savemat(path, {"run1": arrays} if within else arrays, oned_as="column")
    else:
        with h5py.File(path, "w") as file:
            for name, values, unit in zip(head, np.array(draft.rows, float).T, units, strict=True):
                file[within + name] = values
                file[within + name].attrs.update({"unit": unit} if apart else {})


def odd(seed: int, folder: Path) -> Odd:
    """Write the file of a seed to a folder, and return what is true of it."""
    rng = np.random.default_rng(seed)
    plain = bool(rng.random() < 0.5)
    draft, period = _draft(rng, plain)
    form, truth, columns = draft.form, draft.truth, draft.columns
    each = list(DAMAGES.items())[: 3 if plain else None]
    fits = [name for name, (_, kinds, need) in each if form.kind in kinds and draft.has(need)]
    damage = _one(rng, ["no damage"] * 4 * plain + fits)
    DAMAGES[damage][0](draft)
    encodings = ("utf-8", "utf-8-sig", "utf-16", OLD_ENCODINGS.get(draft.language, "cp1252"))
    encoding = _one(rng, encodings, (5, 2, 1, 2)) if form.kind in ("text", "blanks") else "utf-8"
    path, head = (
        folder / f"odd{seed}{form.suffix}",
        _header(draft) if draft.language != "no" else [],
    )
    _write(draft, path, head, encoding)
    places = dict(zip(columns, head or range(1, len(columns) + 1), strict=True))
    units = {c: unit for c, unit in zip(columns, draft.units, strict=True) if c in truth}
    gaps = any(np.isnan(values).any() for values in truth.values())
    facts = {"units": units, "columns": {c: places[c] for c in units}, "rate": 1_000_000 / period}
    facts |= {"time": places.get(draft.clock.name), "gaps": gaps, "plain": plain}
    about = (
        f"{'plain' if plain else 'odd'}: {path.suffix} {form.separator!r} {form.decimal} {encoding}; "
        f"{draft.language} header, {draft.style}, {' '.join(units.values())}; {draft.clock.label} in "
        f"steps of {draft.grain} us, {'un' * bool(np.ptp(np.diff(draft.times)))}even; {damage}"
    )
    return Odd([path], truth, period / 1e6, facts, about)

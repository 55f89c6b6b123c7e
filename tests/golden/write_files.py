"""Write the inputs of `tests/golden/rooms/files.py`: ``python -m tests.golden.write_files``.

It was run once. The bytes in ``files/`` are what counts: the formats' libraries stamp dates and
versions into theirs, so that writing them again gives other bytes, and other digests in the answers.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

FILES = Path(__file__).parent / "files"
N, STEP = 40, 0.02

K = np.arange(N)
TIME: Array = (2 * K / 100).round(2)
PRESSURE: Array = (1.5 - (1.5 - 0.011 * K) * np.cos(2 * np.pi * K / 17)).round(4)
"""[bar]"""
TRAVEL: Array = (5.1 * PRESSURE + 0.4 * np.sin(2 * np.pi * K / 17) + 0.3).round(4)
"""[mm]"""

Cells = Sequence[object]


def text(
    headers: str,
    columns: Sequence[Cells | Array],
    separator: str = ",",
    decimal: str = ".",
    ends: str = "\n",
    before: str = "",
) -> str:
    """Return a table as text: numbers with the digits that they have, or words as they are."""

    def cell(value: object) -> str:
        if isinstance(value, str):
            return value
        return f"{value:.9g}".replace(".", decimal)

    rows = [separator.join(map(cell, row)) for row in zip(*columns, strict=True)]
    return before + ends.join([headers, *rows]) + ends


def written(place: str, content: str | bytes, encoding: str = "utf-8") -> Path:
    """Write a file below ``files/`` and return its path."""
    path = FILES / place
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    return path


def changed(values: Array, cells: Mapping[int, object]) -> list[object]:
    """Return a column with some of its cells written otherwise."""
    return [cells.get(k, value) for k, value in enumerate(values.tolist())]


def stamps(form: Callable[[datetime], str], first: datetime, n: int = N) -> list[str]:
    """Return instants 20 ms apart in some form."""
    return [form(first + timedelta(milliseconds=20 * k)) for k in range(n)]


PLAIN = "time_s,pressure_bar,displacement_mm"
THREE: tuple[Array, ...] = (TIME, PRESSURE, TRAVEL)


def dialects() -> None:
    """Separators, decimal marks, encodings, lines before the table."""
    written("plain.csv", text(PLAIN, THREE))
    written(
        "semicolon-comma.csv",
        text("Zeit [s];Druck [kPa];Weg [mm]", (TIME, 100 * PRESSURE, TRAVEL), ";", ","),
    )
    written(
        "latin-1.csv",
        text("Zeit (ms);Druck (bar);Länge (µm)", (1e3 * TIME, PRESSURE, 1e3 * TRAVEL), ";", ","),
        "latin-1",
    )
    written("utf-16.csv", text(PLAIN.replace(",", "\t"), THREE, "\t"), "utf-16")
    written("bom-crlf.csv", text(PLAIN, THREE, ends="\r\n"), "utf-8-sig")
    units = "s\tpsi\tcm\n"
    columns = (TIME, (14.5 * PRESSURE).round(3), (TRAVEL / 10).round(5))
    head = "time\tpressure\tdisplacement\n" + units
    written("unit-row.tsv", text("", columns, "\t", before=head).replace("\n\n", "\n", 1))
    blanks = text("Time (s)   Pressure (bar)   Stroke [mm]", THREE, "    ")
    written("blanks.txt", blanks)
    written("pipes.dat", text("t | p [MPa] | d [m]", (TIME, PRESSURE / 10, TRAVEL / 1e3), " | "))
    written(
        "sep-line.csv", text("time_s;pressure_bar;displacement_mm", THREE, ";", before="sep=;\n")
    )
    remarks = "# bench 3, muscle DMSP-10\n% second remark\n\n"
    written("comments.csv", text(PLAIN, THREE, before=remarks))
    written("header-in-comment.txt", text("# t p_kPa d_mm", (TIME, 100 * PRESSURE, TRAVEL), " "))
    bare = text("", THREE).lstrip("\n")
    written("no-header.csv", bare)
    quoted = [f'"{value:.4f}"' for value in TRAVEL.tolist()]
    written(
        "quoted.csv", text('"time, s","pressure, bar","displacement, mm"', (TIME, PRESSURE, quoted))
    )
    written("empty-last-column.csv", text(PLAIN + ",", (*THREE, [""] * N)))
    grouped = [f'"{value:,.2f}"' for value in (1e5 * PRESSURE).tolist()]
    written("thousands.csv", text("time_s,pressure_Pa,displacement_mm", (TIME, grouped, TRAVEL)))
    doubtful = [f"{1 + value:.3f}" for value in TRAVEL.tolist()]
    written("three-digits.csv", text(PLAIN, (TIME, PRESSURE, doubtful)))
    mixed = [f"{value:.3f}" if k % 3 else f"{value:.0f}" for k, value in enumerate(1 + TRAVEL)]
    written("mixed-digits.csv", text(PLAIN, (TIME, PRESSURE, mixed)))
    ragged = text(PLAIN, THREE).splitlines()
    written("ragged.csv", "\n".join([*ragged[:20], ragged[20] + ",7", *ragged[21:]]) + "\n")
    written("no-number.csv", text(PLAIN, (TIME, PRESSURE, changed(TRAVEL, {12: "off"}))))
    words = ["up" if k % 17 < 9 else "down" for k in range(N)]
    written("text-column.csv", text(PLAIN + ",phase", (*THREE, words)))
    written("empty.csv", "")
    written("too-short.csv", text(PLAIN, [each[:6] for each in THREE]))
    written("scientific.csv", text(PLAIN, (TIME, [f"{v:+.3E}" for v in PRESSURE.tolist()], TRAVEL)))


def times() -> None:
    """Units of time, dates, counters, what is not uniform."""
    rest = "pressure_bar,displacement_mm"
    two = (PRESSURE, TRAVEL)
    start = datetime(2026, 12, 31, 23, 59, 59, 700000, UTC)
    forms: dict[str, Callable[[datetime], str]] = {
        "dates-iso": lambda at: at.isoformat(timespec="milliseconds").removesuffix("+00:00"),
        "dates-zone": lambda at: at.isoformat(timespec="milliseconds").replace("+00:00", "+09:00"),
        "dates-german": lambda at: f"{at:%d.%m.%Y %H:%M:%S}.{at.microsecond // 1000:03d}",
        "dates-month-name": lambda at: f"{at:%d-%b-%Y %H:%M:%S}.{at.microsecond // 1000:03d}",
        "dates-us-am-pm": lambda at: f"{at:%m/%d/%Y %I:%M:%S}.{at.microsecond // 1000:03d} {at:%p}",
    }
    for name, form in forms.items():
        written(f"{name}.csv", text("timestamp," + rest, (stamps(form, start), *two)))
    start = start.replace(month=4, day=3)  # the day is known by the dots alone
    german = stamps(forms["dates-german"], start)
    written("dates-dots.csv", text("timestamp," + rest, (german, *two)))
    days = [f"{1 + k % 9:02d}/{2 + k // 9:02d}/2026" for k in range(N)]
    written("dates-ambiguous.csv", text("date," + rest, (days, *two)))
    clock = stamps(lambda at: f"{at:%H:%M:%S.%f}"[:-3], datetime(2026, 1, 1, 9, 30, tzinfo=UTC))
    written("time-of-day.csv", text("Time," + rest, (clock, *two)))
    began = 1_767_225_600
    epoch = [str(1000 * began + 20 * k) for k in range(N)]
    written("epoch-ms.csv", text("timestamp," + rest, (epoch, *two)))
    epoch = [str(10**9 * began + 20_000_000 * k) for k in range(N)]
    written("epoch-ns.csv", text("timestamp," + rest, (epoch, *two)))
    written("time-ms.csv", text("t_ms," + rest, (1e3 * TIME + 5, *two)))
    written("time-us.csv", text("t (µs)," + rest, (1e6 * TIME, *two)))
    written("time-min.csv", text("elapsed [min]," + rest, ((TIME / 60).round(9), *two)))
    written(
        "spreadsheet-days.csv",
        text("time," + rest, ([repr(46000 + t / 86400) for t in TIME.tolist()], *two)),
    )
    written("counter.csv", text("sample," + rest, (K, *two)))
    written("no-time.csv", text(rest, two))
    jittered = (TIME + 0.003 * np.sin(5.0 * K)).round(5)
    written("jitter.csv", text(PLAIN, (jittered, *two)))
    written("rounded-times.csv", text(PLAIN, ((K / 60).round(3), *two)))
    gap = TIME + np.where(K >= 18, 0.3, 0.0)
    written("gap.csv", text(PLAIN, (gap.round(2), *two)))
    gaps = gap + np.where(K >= 30, 0.1, 0.0)
    written("two-gaps.csv", text(PLAIN, (gaps.round(2), *two)))
    repeated = TIME.copy()
    repeated[21] = repeated[20]
    written("repeated-time.csv", text(PLAIN, (repeated, *two)))
    written("time-back.csv", text(PLAIN, (np.where(K >= 25, TIME - 0.3, TIME).round(2), *two)))
    written("time-missing.csv", text(PLAIN, (changed(TIME, {9: ""}), *two)))
    holes = changed(TRAVEL, {7: "", 8: "NaN", 9: "", 28: "inf"})
    written("holes.csv", text(PLAIN, (TIME, PRESSURE, holes)))
    ends = changed(PRESSURE, {0: "", 1: "", N - 1: "nan"})
    written("holes-at-ends.csv", text(PLAIN, (TIME, ends, TRAVEL)))


def units() -> None:
    """What can be measured, in other units than the package's."""
    more = (np.cos(0.7 * K)).round(5)
    written(
        "units-si.csv",
        text(
            "time/s,p (Pa),length/m,force/kN,angle [mrad],valve_voltage_mV,velocity m/s,temperature_K",
            (TIME, *(s * more + o for s, o in ((1e5, 2e5), (0.02, 0.2), (0.1, 0.3), (300, 0))),
             *(s * more + o for s, o in ((4000, 5000), (0.05, 0), (3, 300)))),
        ),
    )  # fmt: skip
    written(
        "units-us.csv",
        text(
            "Time (s),Pressure (psig),Stroke (in),Load (lbf),Theta (deg),Temp (°F),contraction_%",
            (TIME, *(s * more + o for s, o in ((20, 40), (0.4, 1), (30, 60), (25, 10))),
             *(s * more + o for s, o in ((9, 80), (10, 12)))),
        ),
    )  # fmt: skip
    written(
        "units-other.csv",
        text(
            "t_s,pressure_mbar,p_ext_hPa,P2 [kgf/cm^2],displacement_cm,load_gf,flow_l/min,u1_V",
            (TIME, *(s * more + o for s, o in ((900, 2000), (800, 1500), (1, 2), (0.5, 1))),
             *(s * more + o for s, o in ((150, 200), (3, 4), (2, 5)))),
        ),
    )  # fmt: skip
    written(
        "antagonists.csv",
        text("t_s,p1_bar,P 2 [kPa],theta_deg", (TIME, PRESSURE, 400 - 100 * PRESSURE, 30 * more)),
    )
    written(
        "log.csv",
        text(
            "t_ms,ref_mm,p_cmd_kPa,p_kPa,pos_mm",
            (1e3 * TIME, TRAVEL, 100 * PRESSURE, 99 * PRESSURE, (0.9 * TRAVEL).round(4)),
        ),
    )
    written("no-units.csv", text("t,p,d", THREE))
    written("u-y.csv", text("t [s],u [V],y [mm]", (TIME, 2 * PRESSURE, TRAVEL)))
    written("raw.csv", text("stamp,A0,A1,A2", (1e3 * TIME, 0.5 + PRESSURE, 10 - TRAVEL, more)))
    written("unknown-unit.csv", text("time_s,pressure [zorks],displacement_mm", THREE))
    written("wrong-dimension.csv", text("time_s,pressure [mm],displacement_mm", THREE))
    written(
        "two-of-one.csv",
        text("time_s,pressure_bar,Druck [kPa],displacement_mm", (TIME, PRESSURE, PRESSURE, TRAVEL)),
    )
    written(
        "kpa-without-unit.csv",
        text("time_s,pressure,displacement_mm", (TIME, 100 * PRESSURE, TRAVEL)),
    )
    written("held-pressure.csv", text(PLAIN, (TIME, 0 * PRESSURE + 2, TRAVEL)))
    written("held-force.csv", text(PLAIN + ",force_N", (*THREE, 0 * TRAVEL + 1.962)))
    k = np.arange(150)
    slow = (2 + np.sin(0.1 * k)).round(4), (10 + 4 * np.sin(0.1 * k - 0.2)).round(4)
    travel = changed(slow[1], {70: "-9999"})
    written("sentinel.csv", text(PLAIN, ((k / 50).round(2), slow[0], travel)))
    travel = changed(slow[1], {70: "44.2"})
    written("glitch.csv", text(PLAIN, ((k / 50).round(2), slow[0], travel)))


TOML = """[time]
column = "stamp"
unit = "ms"

[channels.pressure]
column = "A0"
unit = "psi"
gain = 2.5
offset = -1.25

[channels.displacement]
column = "A1"
unit = "mm"
gain = -1
offset = 10

[channels.force]
value = 200
unit = "g"

[[files]]
match = "*load400g*"
[files.channels.force]
value = 400

[split]
title = "Two loads"
[[split.tasks]]
name = "the heavier load"
test = ["*load400g*"]
inputs = ["pressure"]
outputs = ["displacement"]
models = ["play"]
"""

SPLIT = """[split]
title = "Five loads"
resample = 0.04

[[split.tasks]]
name = "the heaviest load"
files = ["run*"]
test = ["*5"]
models = ["pi"]

[[split.tasks]]
name = "each in turn"
files = ["run1", "run2", "run3"]
leave_out = ["*1", "*2", "*3"]
models = ["pi"]

[[split.tasks]]
name = "the end of each"
cut = 0.6
inputs = ["displacement"]
outputs = ["pressure"]
models = ["pi"]
"""


def folders() -> None:
    """Several recordings, and one recording in several files."""
    more = (np.cos(0.7 * K)).round(5)
    for load, factor in ((200, 1.0), (400, 0.8)):
        columns = (1e3 * TIME, 0.5 + PRESSURE, 10 - factor * TRAVEL, more)
        written(f"described/run_load{load}g.csv", text("stamp,A0,A1,A2", columns))
    written("described/channels.toml", TOML)
    written("described-wrongly/run.csv", text("stamp,A0,A1,A2", (1e3 * TIME, *THREE)))
    written("described-wrongly/channels.toml", TOML + '\n[colours]\npressure = "red"\n')
    written("no-unit-for-gain/run.csv", text("stamp,A0,A1,A2", (1e3 * TIME, *THREE)))
    written("no-unit-for-gain/channels.toml", "[channels.pressure]\ngain = 2\n")
    for i, scale in enumerate((1.0, 0.5, 0.25), start=1):
        written(f"runs/run{i}.csv", text(PLAIN, (TIME, scale * PRESSURE, scale * TRAVEL)))
    written("signals/pressure_kPa.csv", text("t_s,value", (TIME, 100 * PRESSURE)))
    written("signals/displacement.csv", text("t_s,value_mm", (TIME, TRAVEL)))
    slow = slice(None, None, 2)
    written("clocks/pressure.csv", text("t_s,p_bar", (TIME, PRESSURE)))
    written(
        "clocks/displacement.csv", text("t_s,d_mm", ((TIME[slow] + 0.005).round(3), TRAVEL[slow]))
    )
    written("untold/a.csv", text("x", (PRESSURE,)))
    written("untold/b.csv", text("x", (TRAVEL,)))
    for i in (1, 2):
        written(f"joined/u{i}.csv", text("x", (PRESSURE / i,)))
        written(f"joined/y{i}.csv", text("x", (TRAVEL / i,)))
    written(
        "joined/channels.toml",
        '[time]\nsample_time = 0.004\n[[files]]\njoin = ["u*.csv", "y*.csv"]\n'
        '[files.channels.pressure]\ncolumn = "u"\nunit = "bar"\n'
        '[files.channels.displacement]\ncolumn = "y"\nunit = "cm"\n',
    )
    k = np.arange(160)
    rng = np.random.default_rng(1)
    for i in range(1, 6):
        swing = np.sin(rng.uniform(0.08, 0.12) * k + i) + np.sin(rng.uniform(0.15, 0.2) * k)
        p = (2.2 + 0.8 * swing + 0.01 * rng.normal(size=k.size)).round(4)
        d = p.copy()
        for j in range(1, k.size):
            d[j] = min(max(d[j - 1], p[j] - 0.3), p[j] + 0.3)
        travel = (5 - i / 10) * (p + d) / 2 + 0.02 * rng.normal(size=k.size)
        written(f"split/run{i}.csv", text(PLAIN, ((k / 50).round(2), p, travel.round(4))))
    written("split/channels.toml", SPLIT)
    written("nothing/readme.md", "No recordings here.\n")


def own() -> None:
    """What this package writes, and what a person changed of it since."""
    import mckibben

    recording = mckibben.Recording(
        {"pressure": PRESSURE / 3, "displacement": TRAVEL / 7, "strain": TRAVEL / 100},
        sample_time=0.02,
        units={"strain": "1e-3"},
        start_time=1.5,
        meta={"rig": "bench 3", "load": {"mass_kg": 0.2}, "muscle": ["DMSP-10", 250]},
    )
    for name in ("own.csv", "own.tsv", "own.parquet", "own-changed.csv"):
        mckibben.write(recording, FILES / name)
    changed_since = (FILES / "own-changed.csv").read_text().replace(",", ", ", 1)
    written("own-changed.csv", changed_since)
    without = mckibben.Recording({"pressure": PRESSURE, "force": 10 * TRAVEL})
    mckibben.write(without, FILES / "own-without-time.csv")


def main() -> None:
    """Write all."""
    from tests.golden.write_binary_files import binary

    for part in (dialects, times, units, folders, own, binary):
        part()
    total: Any = {
        str(p.relative_to(FILES)): p.stat().st_size for p in FILES.rglob("*") if p.is_file()
    }
    print(json.dumps({"files": len(total), "bytes": sum(total.values())}))


if __name__ == "__main__":
    main()

"""Write the inputs of `tests/golden/rooms/wrong_files.py`, and their right answers as far as none is
stored: ``python -m tests.golden.write_wrong_files``.

A right answer is worked out here from the numbers that the input was made of, never by the package.
Those that it does not give today are stored as expected to fail.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tests.golden.__main__ import answer
from tests.golden.case import flat
from tests.golden.compare import moved
from tests.golden.rooms import all_cases
from tests.golden.stored import Stored, load, machine, save
from tests.golden.write_files import (
    FILES,
    PLAIN,
    PRESSURE,
    STEP,
    THREE,
    TIME,
    TRAVEL,
    Array,
    K,
    N,
    changed,
    text,
    written,
)

PSI = 0.45359237 * 9.80665 / 0.0254**2 / 1e5
"""[bar]"""

PIEZO = (
    *("displacement_mm", "displacement_um", "displacement_µm", "Displacement (µm)"),
    *("Displacement [nm]", "displacement_nm", "disp [nm]", "Dpp1 [nm]"),
)
PIEZO_MM = (1.0, 1e-3, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6, 1e-6)

Right = tuple[Mapping[str, Any], str]
"""The right answer, and why it is not today's."""


def read(channels: Mapping[str, tuple[Array, str]], step: float | None = STEP, **more: Any) -> Any:
    """Return the answer of one recording."""
    told = {
        "channels": {name: values for name, (values, _) in channels.items()},
        "units": {name: unit for name, (_, unit) in channels.items()},
        "sample_time": step,
    }
    return {"recordings": [told | more]}


def both(pressure: Array = PRESSURE, travel: Array = TRAVEL, **more: Any) -> Any:
    """Return the answer of a pressure and a displacement."""
    return read({"pressure": (pressure, "bar"), "displacement": (travel, "mm")}, **more)


def refused(channel: str) -> Any:
    """Return a refusal of a channel."""
    return {"refused": {"class": "DataError", "channel": channel}}


def units() -> dict[str, Right]:
    """What a unit says that the samples deny, and the other way round."""
    supply = (190 * PRESSURE).round(2)
    written("wrong/kpa-called-bar.csv", text(PLAIN, (TIME, supply, TRAVEL)))
    supply = (2.2 * PRESSURE + 0.1).round(4)
    written(
        "wrong/bar-called-mpa.csv", text("time_s,p [MPa],displacement_mm", (TIME, supply, TRAVEL))
    )
    written("wrong/psi-called-bar.csv", text(PLAIN, (TIME, (30 * PRESSURE).round(3), TRAVEL)))
    ms = 1e3 * TIME
    written("wrong/ms.csv", text("stamp,pressure_bar,displacement_mm", (ms, PRESSURE, TRAVEL)))
    absolute = (PRESSURE + 1.013).round(4)
    written(
        "wrong/bara.csv", text("time_s,pressure_bara,displacement_mm", (TIME, absolute, TRAVEL))
    )
    psi = (14 * PRESSURE + 14.7).round(3)
    written("wrong/psia.csv", text("time_s,Pressure (psia),displacement_mm", (TIME, psi, TRAVEL)))
    denied = text("s,kPa,mm", (TIME, 100 * PRESSURE, TRAVEL), before=PLAIN + "\n")
    written("wrong/unit-row.csv", denied)
    high = "a pressure of more than 60 bar, which no muscle sees, is believed: issue 41"
    ms_said = "times in ms are taken for s, and a step of 20 s is told in a note: issue 41"
    gauge = "an absolute pressure passes for gauge without the promised note: issue 41"
    told: dict[str, Any] = {"reference": {"pressure": "absolute"}, "warned": True}
    return {
        "kpa-called-bar": (refused("pressure"), high),
        "bar-called-mpa": (refused("pressure"), high),
        "psi-called-bar": (refused("pressure"), high),
        "ms-of-a-column": (refused("time"), ms_said),
        "ms-of-a-matrix": (refused("time"), ms_said),
        "bara": (both(absolute, **told), gauge),
        "psia": (both(psi * PSI, **told), gauge),
        "unit-row-denies-header": (
            refused("pressure"),
            "a row of units goes before the header, which says another, without a word: issue 41",
        ),
    }


def heads() -> dict[str, Right]:
    """What stands above the samples."""
    before = "Pressure bench 3\noperator: A\n\n"
    written("wrong/titles.csv", text(PLAIN, THREE, before=before))
    japanese = text("時間(s),圧力(kPa),変位(mm)", (TIME, 100 * PRESSURE, TRAVEL))
    written("wrong/shift-jis.csv", japanese, "shift-jis")
    written("wrong/japanese.csv", japanese)
    head = "\n".join(
        (
            *("LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab"),
            *(
                "Decimal_Separator\t,",
                "Multi_Headings\tNo",
                "X_Columns\tOne",
                "Time_Pref\tRelative",
            ),
            *("Date\t2025/03/01", "Time\t10:11:12,5", "***End_of_Header***\t", "", "Channels\t2\t"),
            *(f"Samples\t{N}\t{N}", "Y_Unit_Label\tbar\tmm", "X_Dimension\tTime\tTime"),
            *("X0\t0,0\t0,0", "Delta_X\t0,020000\t0,020000", "***End_of_Header***\t\t", ""),
        )
    )
    columns: tuple[Any, ...] = (*THREE, [""] * N)
    table = text("X_Value\tpressure\tdisplacement\tComment", columns, "\t", ",", before=head)
    for place in ("labview.lvm", "labview.txt", "labview/run.lvm"):
        written(f"wrong/{place}", table)
    lvm = "files of LabVIEW (.lvm) are not read: issue 41"
    mojibake = "headers in Shift-JIS are misread, and 時間, 圧力, 変位 are not known: issue 41"
    return {
        "titles": (both(), "title lines above a header are refused in a text: issue 41"),
        "titles-of-two-cells": (
            both(),
            "a title of two cells is taken for the header, and the header for units: issue 41",
        ),
        "shift-jis": (both(), mojibake),
        "japanese-utf-8": (both(), mojibake),
        "lvm": (both(), lvm),
        "lvm-called-txt": (both(), lvm),
        "lvm-in-a-folder": (both(), lvm),
    }


def cells() -> dict[str, Right]:
    """What stands in cells that is no number, or a number that was not measured."""
    words = [f"{p:.4f} bar" for p in PRESSURE]
    written(
        "wrong/units-in-cells.csv", text("time_s,pressure,displacement_mm", (TIME, words, TRAVEL))
    )
    counts = [f"0x{int(1000 * p):04X}" for p in PRESSURE]
    written("wrong/hexadecimal.csv", text(PLAIN, (TIME, counts, TRAVEL)))
    travel = (TRAVEL - 12).round(4)
    minus = [f"{value:.4f}".replace("-", "−") for value in travel.tolist()]
    written("wrong/minus-sign.csv", text(PLAIN, (TIME, PRESSURE, minus)))
    written("wrong/all-missing.csv", text(PLAIN, (TIME, PRESSURE, [""] * N)))
    k = np.arange(150)
    t, p = (k / 50).round(2), (2 + np.sin(0.1 * k)).round(4)
    d: Array = (28 + 6 * np.sin(0.1 * k - 0.2)).round(4)

    def slow(place: str, cells: Mapping[int, object], head: str = PLAIN, by: Array = d) -> None:
        written(f"wrong/{place}.csv", text(head, (t, p, changed(by, cells))))

    slow("zeros", {at + i: 0.0 for at in (30, 71, 120) for i in range(8)})
    slow("sentinels", {80 + i: -9999.0 for i in range(6)})
    few = changed(TRAVEL, {25: -9999.0})
    written("wrong/sentinel-few.csv", text(PLAIN, (TIME, PRESSURE, few)))
    counted = np.rint(2200 * d).astype(np.int64)
    head = "time_s,pressure_bar,displacement_um"
    slow("wrap", {}, head, (counted % 2**16).astype(float))
    slow("wrap-signed", {}, head, ((counted // 2 + 2**15) % 2**16 - 2**15).astype(float))
    vanishes = "a column whose cells are no plain numbers vanishes without a word: issue 41"
    fitted = "what stands for missing samples is taken for measured: issue 41"
    wraps = "a counter that wraps is taken for a jump of the displacement: issue 41"
    first = "an output that moves before its cause is fitted: issue 41"
    late = np.interp(k - 5, k, p).round(4)
    written("wrong/output-first.csv", text(PLAIN, (t, late, (3 * p + 1).round(4))))
    return {
        "units-in-cells": (both(), vanishes),
        "hexadecimal": (refused("pressure"), vanishes),
        "minus-sign": (both(travel=travel), vanishes),
        "all-missing": (
            refused("displacement"),
            "a channel without a single number vanishes without a word: issue 41",
        ),
        "zeros-for-missing": (refused("displacement"), fitted),
        "sentinels-in-a-row": (refused("displacement"), fitted),
        "sentinel-in-few-samples": (refused("displacement"), fitted),
        "wrap-of-16-bits": (refused("displacement"), wraps),
        "wrap-of-signed-16-bits": (refused("displacement"), wraps),
        "output-before-cause": (refused("displacement"), first),
    }


def binary() -> dict[str, Right]:
    """MATLAB files and a spreadsheet as others publish them."""
    import openpyxl
    import scipy.io as sio

    n = 410
    turns = np.linspace(0, 40 * np.pi, n)
    angle = np.sin(turns)
    force = angle + 0.2 * np.sign(np.cos(turns))
    tables = {
        "Rd": np.linspace(0.94, 0.99, 20),
        "thf_zc": np.linspace(1, 2, 20),
        "val": 3.0 + np.arange(20),
        "rot_ratio_amp": np.linspace(1, 100, 20),
    }
    rows = {name: values[None] for name, values in {"M1": force, "thf": angle, **tables}.items()}
    sio.savemat(FILES / "wrong/case-01.mat", rows, do_compression=True)
    signals = np.zeros((1, 2), dtype=[("Name", "O"), ("Unit", "O"), ("Data", "O")])
    signals[0, 0] = ("pressure", "bar", PRESSURE)
    signals[0, 1] = ("displacement", "mm", TRAVEL)
    desk = {"exp1": {"X": {"Name": "time", "Data": TIME}, "Y": signals}}
    sio.savemat(FILES / "wrong/case-03.mat", desk, do_compression=True)
    each = {"pressure": {"t": TIME, "y": PRESSURE}, "displacement": {"t": TIME, "y": TRAVEL}}
    sio.savemat(FILES / "wrong/case-03b.mat", each, do_compression=True)
    sio.savemat(FILES / "wrong/ms.mat", {"data": np.column_stack([1e3 * TIME, PRESSURE, TRAVEL])})
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for row in (["operator", "A"], [], ["Time (ms)", "Druck (kPa)", "Weg (mm)"]):
        sheet.append(row)
    for values in zip(1e3 * TIME, 100 * PRESSURE, TRAVEL, strict=True):
        sheet.append([float(value) for value in values])
    book.save(FILES / "wrong/titles.xlsx")
    lengths = "of variables of several lengths, the commonest wins, not the recording: issue 41"
    structs = "signals in structs as dSPACE and others save them are lost without a word: issue 41"
    return {
        "tables-beside-recording": (read({"m1": (force, ""), "thf": (angle, "")}, None), lengths),
        "tables-beside-recording-named": (
            read({"angle": (angle, "rad"), "force": (force, "N")}, 1e-3),
            lengths,
        ),
        "struct-array": (both(), structs),
        "struct-a-signal": (both(), structs),
    }


def logs() -> dict[str, Right]:
    """Columns that nobody asks for, and nanometres."""
    t = (0.1 * K).round(1)
    target = 2000 + 100 * np.sign(np.sin(t))
    position = target - 3 * np.sign(np.gradient(target))
    one = np.ones(N)
    columns = (
        t,
        target,
        position,
        one,
        35 * one,
        0 * one,
        target,
        position,
        2 * one,
        36 * one,
        0 * one,
    )
    names = ",".join(
        f"target pos ({i}),pos ({i}),current ({i}),temp ({i}),status ({i})" for i in (1, 2)
    )
    written("wrong/case-09.csv", text("timestamp," + names, columns))
    servos = read({"reference": (target, ""), "position": (position, "")}, 0.1)
    right = {"servos": (servos, "columns that nobody asks for refuse the file: issue 41")}
    volts = (50 - 50 * np.cos(0.3 * K)).round(3)
    for i, (head, unit) in enumerate(zip(PIEZO, PIEZO_MM, strict=True), start=1):
        written(
            f"wrong/case-11-{i}.csv", text(f"time_s,voltage_V,{head}", (TIME, volts, 100 * volts))
        )
        name = "dpp1" if head.startswith("Dpp1") else "displacement"
        channels = {"voltage": (volts, "V"), name: (100 * volts * unit, "mm")}
        right[f"piezo-{i}"] = (read(channels), "nanometres are not understood in headers: issue 41")
    return right


def store(right: Mapping[str, Right]) -> None:
    """Store right answers, marked where today's is another."""
    all_cases.cache_clear()
    for name, (tree, why) in right.items():
        case = all_cases()[f"files/right-{name}"]
        if load(case.name) is not None:
            continue
        leaves, raised, _ = answer(case)
        stored = Stored(flat(tree), "worked out from what the input was made of", machine())
        if leaves is None or moved(case, stored, leaves, machine()):
            said = {k: v for k, v in (leaves or {}).items() if not isinstance(v, np.ndarray)}
            print(f"{case.name}: {raised[-200:] or said}")
            stored = Stored(stored.leaves, stored.reason, stored.machine, why)
        else:
            print(f"{case.name}: right today")
        save(case.name, case.call, stored)


def main() -> None:
    """Write all."""
    (FILES / "wrong").mkdir(parents=True, exist_ok=True)
    parts: Sequence[dict[str, Right]] = (units(), heads(), cells(), binary(), logs())
    store({name: right for part in parts for name, right in part.items()})


if __name__ == "__main__":
    main()

"""Units against conversions done by hand."""

from pathlib import Path

import numpy as np
import pytest

import mckibben
from mckibben.files.headers import channel_of, parse
from mckibben.files.names import UNITS, plain, words_of
from mckibben.files.units import find
from tests.files.made import one, place, put, refused

FACTORS = {
    "pressure": {
        "kPa": 0.01, "MPa": 10.0, "Pa": 1e-05, "mbar": 0.001, "psi": 0.0689475729,
        "psig": 0.0689475729, "atm": 1.01325, "mmHg": 0.00133322387, "MBAR": 0.001, "mpa": 10.0,
        "N/mm²": 10.0, "kgf/cm2": 0.980665, "Torr": 0.00133322368, "inH2O": 0.00249088908,
        "bar": 1.0},
    "displacement": {
        "m": 1000.0, "cm": 10.0, "µm": 0.001, "μm": 0.001, "inch": 25.4, "Mm": 1000000000.0,
        "MM": 1.0, "nm": 1e-06, "㎜": 1.0, "mil": 0.0254, "km": 1000000.0, "毫米": 1.0, "mm": 1.0},
    "force": {
        "kN": 1000.0, "KN": 1000.0, "MN": 1000000.0, "mN": 0.001, "kgf": 9.80665,
        "lbf": 4.4482216, "N": 1.0},
    "angle": {"deg": np.pi / 180, "°": np.pi / 180, "rev": 2 * np.pi, "rad": 1.0},
    "voltage": {"mV": 0.001, "V": 1.0},
    "velocity": {"m/s": 1000.0, "mm s^-1": 1.0, "cm/min": 1 / 6, "mm/s": 1.0},
    "time": {"ms": 0.001, "min": 60.0, "h": 3600.0},
    "contraction": {"%": 0.01, "mm/mm": 1.0},
    "torque": {"Nm": 1.0, "mN·m": 0.001, "N*m": 1.0},
    "angular_velocity": {"rpm": np.pi / 30, "°/s": np.pi / 180, "rad/s": 1.0},
    "current": {"mA": 0.001, "A": 1.0},
}  # fmt: skip
RIGHT = np.linspace(0.01, 0.3, 20)


@pytest.mark.parametrize(
    ("channel", "unit"), [(channel, unit) for channel in FACTORS for unit in FACTORS[channel]]
)
def test_factor(tmp_path: Path, channel: str, unit: str) -> None:
    factor = FACTORS[channel][unit]
    cells = RIGHT if factor == 1 else RIGHT / factor
    recording = one(put(tmp_path / "a.csv", f"x,{channel}", RIGHT, cells), units={channel: unit})
    found = recording.time if channel == "time" else recording[channel]
    assert found == pytest.approx(RIGHT)
    assert (found.tolist() == RIGHT.tolist()) or factor != 1  # what is converted to itself is equal


@pytest.mark.parametrize(("unit", "gain", "zero"), [("K", 1, -273.15), ("°F", 5 / 9, -160 / 9)])
def test_temperatures_have_an_offset(tmp_path: Path, unit: str, gain: float, zero: float) -> None:
    cells = 300 + np.arange(20)
    found = one(put(tmp_path / "a.csv", "temperature", cells), units={"temperature": unit})
    assert found["temperature"] == pytest.approx(gain * cells + zero)


LABS = {  # headers as labs write them -> channel and factor to the package's unit
    "Zeit (Sekunden)": ("time", 1), "Temps écoulé [secondes]": ("time", 1),
    "tiempo_milisegundos": ("time", 1e-3), "时间（毫秒）": ("time", 1e-3), "시간(초)": ("time", 1),
    "Innendruck (Kilopascal)": ("pressure", 0.01), "presion_mmHg": ("pressure", 0.00133322387),
    "Pression [mm Hg]": ("pressure", 0.00133322387), "气压（兆帕）": ("pressure", 10),
    "圧力 [キロパスカル]": ("pressure", 0.01), "Pressão (quilopascal)": ("pressure", 0.01),
    "Déplacement (millimètres)": ("displacement", 1), "deplacement_millimetre": ("displacement", 1),
    "Hub (Zentimeter)": ("displacement", 10), "Spostamento (centimetri)": ("displacement", 10),
    "변위 (밀리미터)": ("displacement", 1), "変位（ミリメートル）": ("displacement", 1),
    "KRAFT (KILONEWTON)": ("force", 1e3), "Effort (newtons)": ("force", 1),
    "effort_2_N": ("force_2", 1), "cable tension [N]": ("cable_tension", 1),
    "拉力（牛顿）": ("force", 1), "Tension (volts)": ("voltage", 1), "電圧（ボルト）": ("voltage", 1),
    "Winkel in Grad": ("angle", np.pi / 180), "angulo_graus": ("angle", np.pi / 180),
    "角度（度）": ("angle", np.pi / 180), "Velocità (metri/secondo)": ("velocity", 1e3),
    "velocidad (milímetros por segundo)": ("velocity", 1), "速度（毫米/秒）": ("velocity", 1),
    "Drehmoment (Newton·Meter)": ("torque", 1), "contracción (por ciento)": ("contraction", 0.01),
}  # fmt: skip


@pytest.mark.parametrize("header", LABS)
def test_headers_of_labs_in_their_languages(tmp_path: Path, header: str) -> None:
    channel, factor = LABS[header]
    cells = RIGHT / factor
    columns = [RIGHT, cells] if channel != "time" else [cells, RIGHT]
    names = ["time_s", header] if channel != "time" else [header, "force_N"]
    recording = one(put(tmp_path / "a.csv", ";".join(names), *columns, separator=";"))
    found = recording.time if channel == "time" else recording[channel]
    assert found == pytest.approx(RIGHT)


def test_every_word_is_its_unit_in_any_case_and_without_accents() -> None:
    for word, symbol in words_of(UNITS).items():
        text = word.replace("_", " ")
        for form in {text, text.upper(), text.capitalize(), plain(text), f"{text}."}:
            assert symbol in ("/", "absolute", "gauge") or find(form) == find(symbol) is not None


@pytest.mark.parametrize("word", ["Druck absolut [bar]", "pression (bar absolus)", "p (kPa 绝对)"])
def test_words_for_absolute_pressure(word: str) -> None:
    header = parse(word)
    assert channel_of(header) == "pressure"
    assert header.unit is not None
    assert getattr(find(header.unit), "reference", None) == "absolute"


@pytest.mark.parametrize("name", ["pressure_second", "pressure_grad", "forza_pollice"])
def test_words_that_are_units_elsewhere_stay_names(name: str) -> None:
    assert parse(name).unit is None


NONE = ["foo", "NM", "9**9**9", "10^10^10", "__import__", "bar;", "a" * 1000, "(", "1e9"]
OTHER = ["counts", "LSB", "px", "L/min", "J"]  # which no channel has


@pytest.mark.parametrize("unit", NONE + OTHER)
def test_what_is_no_unit_of_a_channel(tmp_path: Path, unit: str) -> None:
    path = put(tmp_path / "a.csv", "pressure", RIGHT)
    assert place(path, units={"pressure": unit}) == ("pressure", None)


@pytest.mark.parametrize(
    ("header", "size", "remedy"),
    [
        ("pressure (mPa)", 0.01, "units[pressure]=MPa"),
        ("pressure (bar)", 1e300, "units[pressure]="),
        ("pressure (kPa)", 1e300, "units[pressure]="),
        ("pressure (MPa)", 300.0, "units[pressure]="),
        ("pressure (bar)", 4.9e5, "units[pressure]=Pa"),
        ("pressure (bar)", 100.0, "units[pressure]=kPa"),
        ("pressure (MPa)", 100.0, "units[pressure]=kPa"),
        ("displacement (mm)", 1e9, "units[displacement]="),
        ("displacement (mm)", 1e4, "units[displacement]=um"),
        ("displacement (km)", 1e3, "units[displacement]="),
        ("force (GN)", 1.0, "units[force]="),
        ("force (N)", 1e7, "units[force]=mN"),
        ("temperature (°C)", 1e6, "units[temperature]="),
        ("displacement_px", 1.0, "calibration[displacement]="),
        ("pressure_counts", 1.0, "calibration[pressure]="),
        ("FORCE_NM", 1.0, "units[force]="),
        ("pressure", 10.0, "units[pressure]="),
        ("angle", 23.0, "units[angle]="),
        ("contraction", 6.0, "units[contraction]="),
        ("displacement", 0.008, "units[displacement]="),
    ],
)
def test_impossible_values_are_refused_and_the_proposed_unit_is_read(
    tmp_path: Path, header: str, size: float, remedy: str
) -> None:
    cells = size * (1 + np.arange(20) / 7)
    path = put(tmp_path / "a.csv", f"t_s;{header}", range(20), cells, separator=";")
    error = refused(path)
    channel, unit = remedy.partition("[")[2].split("]=")
    assert error.channel == channel
    assert remedy in error.remedy
    if unit:
        factor = {"um": 0.001, "mN": 0.001, **FACTORS["pressure"]}[unit]
        assert one(path, units={channel: unit})[channel] == pytest.approx(factor * cells)


@pytest.mark.parametrize(
    ("header", "cell"),
    [("pressure (mPa)", "0"), ("p [bar]", "1e-17"), ("p [Pa]", "2.5"), ("force (mN)", "1e-4")],
)
def test_nothing_rounding_and_small_values_are_read(tmp_path: Path, header: str, cell: str) -> None:
    path = put(tmp_path / "a.csv", f"t_s;{header}", range(20), [cell] * 20, separator=";")
    assert len(one(path)) == 20


@pytest.mark.parametrize(
    ("header", "factor", "offset"),
    [
        ("displacement_2 (cm)", 10.0, 0.0),
        ("contraction_2 (%)", 5.0, 0.0),
        ("length_2 (mm)", -1.0, 500.0),
    ],
)
def test_the_rest_length_makes_each_measure_of_a_motion_of_another(
    tmp_path: Path, header: str, factor: float, offset: float
) -> None:
    displacement = 1.0 + np.arange(20.0)
    cells = (displacement - offset) / factor
    path = put(tmp_path / "a.csv", f"t_s,{header}", range(20), cells)
    measures = {
        "displacement_2": displacement,
        "contraction_2": displacement / 500,
        "length_2": 500 - displacement,
    }
    for channel, expected in measures.items():
        found = one(path, channels=[channel], rest_length=500.0)
        assert found[channel] == pytest.approx(expected)
        assert found.rest_length == 500.0
        assert found.matrix(measures) == pytest.approx(np.column_stack([*measures.values()]))
        mckibben.write(found, tmp_path / "own.csv")
        assert one(tmp_path / "own.csv", channels=[*measures])[channel] == pytest.approx(expected)
        if channel not in one(path):
            assert "rest_length" in refused(path, channels=[channel]).remedy


def test_millimetres_called_a_contraction_are_refused_with_what_reads_them(tmp_path: Path) -> None:
    displacement = 6.0 + np.arange(20.0)
    path = put(tmp_path / "a.csv", "t_s,contraction", range(20), displacement)
    for options in ({}, {"units": {"contraction": "mm"}}):
        (*_, asked) = [o for o in refused(path, **options).options if "columns" in o]
        assert asked["columns"] == {"displacement": "contraction"}
        assert asked["units"]["displacement"] == "mm"
    named = {"columns": {"displacement": "contraction"}, "units": {"displacement": "mm"}}
    found = one(path, channels=["contraction"], rest_length=500.0, **named)
    assert found["contraction"] == pytest.approx(displacement / 500)
    assert "millimetres" in refused(path, channels=["contraction"], rest_length=0.5, **named).remedy
    assert refused(path, rest_length=-1.0).remedy

"""Units against conversions done by hand."""

from pathlib import Path

import numpy as np
import pytest

import mckibben
from mckibben import DataError
from mckibben.files.units import SPELLINGS, Unit, convert, find

FACTORS = {
    "bar": {
        "kPa": 0.01, "MPa": 10.0, "Pa": 1e-05, "mbar": 0.001, "psi": 0.0689475729,
        "psig": 0.0689475729, "atm": 1.01325, "mmHg": 0.00133322387, "MBAR": 0.001, "mpa": 10.0,
        "N/mm²": 10.0, "kgf/cm2": 0.980665, "Torr": 0.00133322368, "inH2O": 0.00249088908},
    "mm": {
        "m": 1000.0, "cm": 10.0, "µm": 0.001, "μm": 0.001, "inch": 25.4, "Mm": 1000000000.0,
        "MM": 1.0, "nm": 1e-06, "㎜": 1.0, "mil": 0.0254, "km": 1000000.0, "毫米": 1.0},
    "N": {
        "kN": 1000.0, "KN": 1000.0, "MN": 1000000.0, "mN": 0.001, "kgf": 9.80665,
        "lbf": 4.4482216},
    "s": {"ms": 0.001, "min": 60.0, "h": 3600.0},
    "rad": {"deg": np.pi / 180, "°": np.pi / 180, "rev": 2 * np.pi},
    "V": {"mV": 0.001},
    "mm/s": {"m/s": 1000.0, "mm s^-1": 1.0, "cm/min": 1 / 6},
    "": {"%": 0.01, "mm/mm": 1.0},
    "N*m": {"Nm": 1.0, "mN·m": 0.001},
    "rad/s": {"rpm": np.pi / 30, "°/s": np.pi / 180},
    "A": {"mA": 0.001},
}  # fmt: skip


def known(text: str) -> Unit:
    unit = find(text)
    assert unit is not None
    return unit


@pytest.mark.parametrize(("target", "text"), [(t, text) for t in FACTORS for text in FACTORS[t]])
def test_factor(target: str, text: str) -> None:
    unit, factor = known(text), FACTORS[target][text]
    assert unit.target == target
    assert convert(np.array([1.0, -3.0]), unit.name, target) == pytest.approx([factor, -3 * factor])


def test_temperatures_have_an_offset() -> None:
    assert convert(np.array([300.0]), known("K").name, "degC") == pytest.approx([26.85])
    assert convert(np.array([212.0]), known("°F").name, "degC") == pytest.approx([100.0])


@pytest.mark.parametrize("target", SPELLINGS)
def test_what_is_in_the_units_of_the_package_is_not_touched(target: str) -> None:
    samples = np.array([0.1, 0.2])
    assert convert(samples, known(target).name, target) is samples


@pytest.mark.parametrize("reference", ["gauge", "absolute", None])
def test_reference_of_a_pressure(reference: str | None) -> None:
    texts = {
        "gauge": ["barg", "kPa(g)"],
        "absolute": ["bara", "bar abs", "kPaA", "bar(a)"],
        None: ["bar"],
    }
    assert {known(text).reference for text in texts[reference]} == {reference}


@pytest.mark.parametrize(
    "text", ["foo", "NM", "9**9**9", "10^10^10", "__import__", "bar;", "a" * 1000, "(", "1e9"]
)
def test_what_is_no_unit(text: str) -> None:
    assert find(text) is None


@pytest.mark.parametrize("text", ["counts", "LSB", "px", "L/min", "J"])
def test_what_is_no_unit_of_a_channel(text: str) -> None:
    assert known(text).target is None


@pytest.mark.parametrize(
    ("header", "factor", "remedy"),
    [
        ("pressure (mPa)", 0.01, "--unit pressure=MPa"),
        ("pressure (bar)", 1e300, "--unit pressure="),
        ("pressure (kPa)", 1e300, "--unit pressure="),
        ("pressure (MPa)", 300.0, "--unit pressure="),
        ("pressure (bar)", 4.9e5, "--unit pressure=Pa"),
        ("displacement (mm)", 1e9, "--unit displacement="),
        ("displacement (km)", 1e3, "--unit displacement="),
        ("force (GN)", 1.0, "--unit force="),
        ("temperature (°C)", 1e6, "--unit temperature="),
        ("displacement_px", 1.0, "--calibrate displacement="),
        ("pressure_counts", 1.0, "--calibrate pressure="),
        ("FORCE_NM", 1.0, "--unit force="),
    ],
)
def test_units_that_cannot_be_stop(tmp_path: Path, header: str, factor: float, remedy: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"t_s;{header}\n" + "".join(f"{k};{factor * (1 + k / 7)}\n" for k in range(20)))
    with pytest.raises(DataError) as caught:
        mckibben.read(path)
    assert caught.value.channel == header.replace("_", " ").split()[0].lower()
    assert remedy in caught.value.remedy


@pytest.mark.parametrize(
    ("header", "cell"),
    [("pressure (mPa)", "0"), ("p [bar]", "1e-17"), ("p [Pa]", "2.5"), ("force (mN)", "1e-4")],
)
def test_nothing_rounding_and_small_values_are_read(tmp_path: Path, header: str, cell: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"t_s;{header}\n" + "".join(f"{k};{cell}\n" for k in range(20)))
    assert len(mckibben.read(path)[0]) == 20

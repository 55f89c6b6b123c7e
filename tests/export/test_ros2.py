"""The exported controller, compiled against stand-ins for ROS's headers, gives Python's numbers."""

from __future__ import annotations

import math
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from mckibben import GPI, ModelError, muscles
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.laws import examples
from mckibben.exporting import export_ros2
from mckibben.exporting.ros2.package import ros2_files
from tests.refusals import refused
from tests.tools import needs

STUBS = Path(__file__).parent / "ros2_stubs"
STEP = 0.01
INVERSE = GPI.example().inverse()
FLAGS = ["-Wall", "-Wextra", "-Wconversion", "-Werror", "-ffp-contract=off", "-O1"]


def built(block: Block, place: Path, *options: str) -> Path:
    """Export and compile a controller with the program that drives it."""
    folder = export_ros2(block, place / "arm", name="arm", sample_time=STEP)
    objects = []
    for source in sorted((folder / "c").glob("*.c")):
        objects.append(place / f"{source.stem}.o")
        subprocess.run(
            ["gcc", "-std=c99", *FLAGS, "-c", source, "-o", objects[-1]], check=True, timeout=100
        )
    n_pressures, n_measured = len(block.outputs), len(block.scheduling)
    command = ["g++", "-std=c++17", *FLAGS, *options]
    command += [f"-I{folder / 'include'}", f"-I{folder / 'c'}"]
    command += [f"-isystem{STUBS}", '-DCONTROLLER_HEADER="arm/arm_controller.hpp"']
    command += ["-DCONTROLLER=arm::ArmController"]
    command += [f"-DN_COMMANDS={n_pressures}", f"-DN_STATES={n_measured}"]
    sources = [folder / "src" / "arm_controller.cpp", STUBS / "drive.cpp"]
    subprocess.run(
        [*command, *sources, *objects, "-o", place / "drive", "-lm"], check=True, timeout=100
    )
    return place / "drive"


def driven(program: Path, lines: list[str], **parameters: float) -> list[str]:
    words = [str(word) for pair in ({"highest": 1e3} | parameters).items() for word in pair]
    text = "\n".join(["configure", "activate", *lines])
    done = subprocess.run(
        [program, *words], input=text, capture_output=True, text=True, check=True, timeout=100
    )
    return done.stdout.splitlines()


def pressures(lines: list[str]) -> list[float]:
    return [float(line) for line in lines]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(INVERSE, tmp_path_factory.mktemp("ros2"))


def wave(k: int) -> float:
    return float(5.0 + 3.0 * np.sin(0.07 * k))


@needs("g++")
def test_a_chained_controller_gives_pythons_numbers(program: Path) -> None:
    lines = [word for k in range(100) for word in (f"reference {wave(k)!r}", "update")]
    (name, *given) = driven(program, ["chained 1", *lines])
    assert name == "controller/displacement"
    stream = INVERSE.stream(STEP)
    expected = [float(stream.step(wave(k))[0]) for k in range(100)]
    np.testing.assert_allclose(pressures(given), expected, rtol=1e-12)


@needs("g++")
def test_silence_is_safe_and_forgets_nothing(program: Path) -> None:
    """References by topic stand for the time-out; then pressures are safe, and memory stands."""
    spoken = [word for k in range(20) for word in (f"say {wave(k)!r}", "update")]
    given = pressures(
        driven(program, ["update", *spoken, *["update"] * 30, *spoken], timeout=0.105, safe=0.5)[1:]
    )
    stream = INVERSE.stream(STEP)
    expected = [float(stream.step(wave(min(k, 19)))[0]) for k in range(30)]
    assert given[0] == 0.5
    np.testing.assert_allclose(given[1:31], expected, rtol=1e-12)
    assert given[31:51] == [0.5] * 20
    after = [float(stream.step(wave(k))[0]) for k in range(20)]
    np.testing.assert_allclose(given[51:], after, rtol=1e-12)


@needs("g++")
def test_numbers_that_are_none_are_not_applied(program: Path) -> None:
    bad = ["say nan", "say inf", "say", "say 1 2"]
    lines = ["say 5.0", "update", *[word for each in bad for word in (each, "update")]]
    assert len(set(pressures(driven(program, lines)[1:]))) == 1
    chained = driven(program, ["chained 1", "reference 5", "update", "reference nan", "update"])
    assert pressures(chained[1:])[1] == 0.0


@needs("g++")
def test_the_status_is_published(program: Path) -> None:
    """All bits since the last message: a glitch of one step is not missed."""
    lines = ["chained 1", "reference 5", "update", "status", "reference 1e6", "update"]
    lines += ["reference 5", "update", "status", "status", "reference 20", "update", "status"]
    found = pressures(driven(program, lines)[1:])
    first, good, glitch, after, bad, none, _, clipped = found
    assert first == glitch == after
    assert [good, bad, none, clipped] == [0, Stream.BAD_INPUT, 0, Stream.CLIPPED]


@pytest.mark.long
@needs("g++")
@pytest.mark.parametrize("options", [(), ("-DOLDER_HANDLES",)])
def test_a_missing_measurement_is_no_reason_to_forget(
    options: tuple[str, ...], tmp_path: Path
) -> None:
    """References come in thousandths of the block's unit."""
    block = examples()["pi-adaptive"]
    program = built(block, tmp_path, *options)
    rows = [(2.0 + math.sin(0.05 * k), 2.2 + math.sin(0.05 * k)) for k in range(60)]
    rows[20:25] = [(reference, np.nan) for reference, _ in rows[20:25]]
    lines = [
        word for r, m in rows for word in (f"say {1e-3 * r!r}", f"state {float(m)!r}", "update")
    ]
    stream = block.stream(STEP)
    expected = [float(stream.step(row)[0]) for row in rows]
    np.testing.assert_allclose(
        pressures(driven(program, lines, reference_scale=1e3)[1:]), expected, rtol=1e-9
    )


@needs("g++")
def test_pressures_are_clipped_and_end_safe(program: Path) -> None:
    lines = [word for k in range(100) for word in (f"say {wave(k)!r}", "update")]
    given = pressures(
        driven(program, [*lines, "deactivate"], lowest=2.5, highest=3.0, safe=2.75)[1:]
    )
    assert min(given) == 2.5
    assert max(given) == 3.0
    assert given[-1] == 2.75


@needs("g++")
@pytest.mark.parametrize("wrong", [{"highest": float("nan")}, {"safe": 2e3}, {"timeout": 0.0}])
def test_wrong_parameters_are_refused(program: Path, wrong: dict[str, float]) -> None:
    with pytest.raises(subprocess.CalledProcessError) as caught:
        driven(program, [], **wrong)
    assert caught.value.returncode == 2


def test_the_package_names_what_it_holds() -> None:
    balance = muscles.load("rail").balance
    files = ros2_files(balance, name="arm_2", sample_time=0.02)
    package, plugin = (ET.fromstring(files[path]) for path in ("package.xml", "arm_2.xml"))
    assert package.findtext("name") == "arm_2"
    (found,) = plugin
    assert found.attrib["type"] == "arm_2::Arm2Controller"
    assert "class Arm2Controller" in files["include/arm_2/arm_2_controller.hpp"]
    assert "update_rate: 50" in files["config/arm_2.yaml"]
    for source in (path for path in files if path.endswith(".c")):
        assert source in files["CMakeLists.txt"]


def test_what_is_no_controller_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError):
        export_ros2(GPI.example(), tmp_path / "a")
    for name in ("Arm", "a__b", "1a", "a-b", "class"):
        with refused(ModelError, parameter="name", names=name):
            export_ros2(INVERSE, tmp_path / "a", name=name)
    assert not (tmp_path / "a").exists()

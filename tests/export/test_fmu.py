"""FMUs are valid, run in two importers, rebuild from their own sources, and give Python's numbers."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import Block, DataError, ModelError
from mckibben.blocks.laws.examples import examples
from mckibben.export import export_fmu
from mckibben.export.fmu.toolchains import own_platform
from tests.export.building import SAMPLE_TIME
from tests.export.models import MODELS, difference, path_for, simulated
from tests.tools import needs

Array = NDArray[np.float64]


def needs_compiler(test: Callable[..., None]) -> Callable[..., None]:
    platform = pytest.mark.skipif(own_platform() is None, reason="FMI knows no such platform")
    return needs("cc")(platform(test))


VERSIONS = ("2.0", "3.0")
SHOWN = ("SDIHC", pytest.param("pi-adaptive", marks=pytest.mark.long))


def exported(block: Block, folder: Path, version: Any, **settings: Any) -> Path:
    path = folder / "muscle.fmu"
    platforms = settings.pop("platforms", [own_platform()])
    return export_fmu(
        block,
        path,
        name="muscle",
        version=version,
        sample_time=SAMPLE_TIME,
        platforms=platforms,
        **settings,
    )


def through_fmpy(path: Path, block: Block, inputs: Array) -> Array:
    """Run an FMU on inputs held over each step, and return the outputs after each."""
    fmpy = pytest.importorskip("fmpy")
    given = [channel.name for channel in block.inputs]
    gives = [channel.name for channel in block.outputs]
    gives = [f"{name}_output" if name in given else name for name in gives]
    n = len(inputs)
    times = SAMPLE_TIME * np.arange(n)
    columns = [("time", np.float64), *((name, np.float64) for name in given)]
    table = np.array([(t, *row) for t, row in zip(times, inputs, strict=True)], dtype=columns)
    result = fmpy.simulate_fmu(
        str(path),
        validate=True,
        start_time=0.0,
        stop_time=n * SAMPLE_TIME,
        output_interval=SAMPLE_TIME,
        step_size=SAMPLE_TIME,
        input=table,
        output=gives,
    )
    return np.column_stack([result[name][1 : n + 1] for name in gives])


@needs_compiler
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", SHOWN)
def test_fmpy_gives_pythons_numbers(name: str, version: str, tmp_path: Path) -> None:
    block, inputs = MODELS[name], path_for(MODELS[name], 1, 150)
    outputs = through_fmpy(exported(block, tmp_path, version), block, inputs)
    assert difference(outputs, simulated(block, inputs)) <= 1e-12


@pytest.mark.parametrize(
    ("kind", "version"), [(kind, VERSIONS[k % 2]) for k, kind in enumerate(examples())]
)
def test_every_block_makes_a_valid_description(kind: str, version: str, tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation")
    path = exported(MODELS[kind], tmp_path, version, platforms=[])
    assert validation.validate_fmu(str(path)) == []


@pytest.mark.long
@needs_compiler
@needs("cmake")
@pytest.mark.parametrize("version", VERSIONS)
def test_it_rebuilds_from_its_own_sources(version: str, tmp_path: Path) -> None:
    pytest.importorskip("fmpy")
    block, inputs = MODELS["SDIHC"], path_for(MODELS["SDIHC"], 1, 50)
    path = exported(block, tmp_path, version, platforms=[])
    with zipfile.ZipFile(path) as archive:
        assert not [entry for entry in archive.namelist() if entry.startswith("binaries")]
    command = [sys.executable, "-m", "fmpy", "compile", str(path), "--all-warnings"]
    subprocess.run([*command, "--warning-as-error"], check=True, capture_output=True)
    assert difference(through_fmpy(path, block, inputs), simulated(block, inputs)) <= 1e-12


@pytest.mark.long
@needs_compiler
@needs("libtbb.so.12")
@pytest.mark.parametrize("version", VERSIONS)
def test_a_second_importer_gives_pythons_numbers(version: str, tmp_path: Path) -> None:
    """Inputs are held at one value after another: each step takes what was set before it."""
    ecos = pytest.importorskip("ecospy", exc_type=ImportError)
    block, inputs = MODELS["per-channel"], path_for(MODELS["per-channel"], 1, 60)
    structure = ecos.EcosSimulationStructure()
    structure.add_model("m", str(exported(block, tmp_path, version)))
    simulation = ecos.EcosSimulation(SAMPLE_TIME, structure=structure)
    simulation.init()
    outputs = []
    for row in inputs:
        for channel, value in zip(block.inputs, row, strict=True):
            simulation.set_real(f"m::{channel.name}", float(value))
        simulation.step(1)
        outputs.append([simulation.get_real(f"m::{channel.name}") for channel in block.outputs])
    simulation.terminate()
    assert difference(np.array(outputs), simulated(block, inputs)) <= 1e-12


@contextmanager
def running(path: Path, version: str) -> Iterator[Any]:
    """Give an instance of an FMU that waits for its first step."""
    fmpy = pytest.importorskip("fmpy")
    place = fmpy.extract(str(path))
    description = fmpy.read_model_description(str(path))
    unit = fmpy.instantiate_fmu(place, description, "CoSimulation")
    if version == "2.0":
        unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    yield unit
    unit.freeInstance()
    shutil.rmtree(place)


@needs_compiler
@pytest.mark.parametrize("version", VERSIONS)
def test_state_is_kept_and_restored(version: str, tmp_path: Path) -> None:
    inputs = path_for(MODELS["gpi"], 1, 40)
    real, state = ("Real", "FMUstate") if version == "2.0" else ("Float64", "FMUState")
    with running(exported(MODELS["gpi"], tmp_path, version), version) as unit:

        def run(rows: Array, start: int) -> list[float]:
            found = []
            for k, row in enumerate(rows, start=start):
                getattr(unit, f"set{real}")([0], [row[0]])
                unit.doStep(k * SAMPLE_TIME, SAMPLE_TIME)
                found.append(getattr(unit, f"get{real}")([1])[0])
            return found

        run(inputs[:20], 0)
        saved = getattr(unit, f"get{state}")()
        first = run(inputs[20:], 20)
        getattr(unit, f"set{state}")(saved)
        getattr(unit, f"free{state}")(saved)
        assert run(inputs[20:], 20) == first
        unit.terminate()


@needs_compiler
@pytest.mark.parametrize("version", VERSIONS)
def test_time_that_goes_back_or_too_far_is_an_error(version: str, tmp_path: Path) -> None:
    path = exported(MODELS["creep"], tmp_path, version)
    for steps in ([(1.0, 0.01), (0.5, 0.01)], [(0.0, 1e300)], [(0.0, 0.0)], [(0.0, -1.0)]):
        with running(path, version) as unit:
            for time, step in steps[:-1]:
                unit.doStep(time, step)
            with pytest.raises(Exception, match=r"(?i)error|status"):
                unit.doStep(*steps[-1])


@needs_compiler
def test_communication_steps_may_be_longer_or_shorter_than_the_models(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    block = MODELS["creep"]
    path = exported(block, tmp_path, "2.0")
    expected = simulated(block, np.full((41, 1), 2.0))
    for factor in (4.0, 0.25):
        table = np.array([(0.0, 2.0), (1.0, 2.0)], dtype=[("time", float), ("displacement", float)])
        result = fmpy.simulate_fmu(
            str(path),
            stop_time=0.4,
            output_interval=SAMPLE_TIME * factor,
            input=table,
            output=["displacement_output"],
        )
        assert result["displacement_output"][-1] == pytest.approx(expected[39, 0], rel=1e-12)


def test_what_makes_no_fmu_is_refused(tmp_path: Path) -> None:
    block = MODELS["pi"]
    with pytest.raises(DataError, match=r"\.fmu"):
        export_fmu(block, tmp_path / "model.zip")
    with pytest.raises(ModelError, match="amiga"):
        export_fmu(block, tmp_path / "model.fmu", platforms=["amiga"])
    with pytest.raises(ModelError, match="linux-arm"):  # which FMI 2 has no name for
        exported(block, tmp_path, "2.0", platforms=["linux-arm"])
    with pytest.raises(ModelError, match="--sample-time"):
        export_fmu(MODELS["creep"], tmp_path / "model.fmu", platforms=[])
    assert list(tmp_path.iterdir()) == []


def test_the_same_model_gives_the_same_bytes_and_a_file_stays(tmp_path: Path) -> None:
    path = exported(MODELS["SDIHC"], tmp_path, "3.0", platforms=[])
    before = path.read_bytes()
    with pytest.raises(DataError) as refused:
        exported(MODELS["pi"], tmp_path, "3.0", platforms=[])
    assert refused.value.file == path
    assert path.read_bytes() == before
    exported(MODELS["SDIHC"], tmp_path, "3.0", platforms=[], overwrite=True)
    assert path.read_bytes() == before


@pytest.mark.parametrize("version", VERSIONS)
def test_units_are_in_si(version: str, tmp_path: Path) -> None:
    path = exported(MODELS["per-channel"], tmp_path, version, platforms=[])
    with zipfile.ZipFile(path) as archive:
        tree = ElementTree.fromstring(archive.read("modelDescription.xml"))
    units = {unit.get("name"): unit.find("BaseUnit") for unit in tree.iter("Unit")}
    pressure, displacement = units["bar"], units["mm"]
    assert pressure is not None
    assert displacement is not None
    assert float(pressure.get("factor", "1")) == 1e5
    assert float(displacement.get("factor", "1")) == 1e-3


@pytest.mark.long
@needs("x86_64-w64-mingw32-gcc")
@pytest.mark.parametrize(("version", "function"), [("2.0", "fmi2DoStep"), ("3.0", "fmi3DoStep")])
def test_the_windows_library_exports_the_interface(
    version: str, function: str, tmp_path: Path
) -> None:
    path = exported(MODELS["pi"], tmp_path, version, platforms=["windows"])
    with zipfile.ZipFile(path) as archive:
        (library,) = (entry for entry in archive.namelist() if entry.endswith("muscle.dll"))
        content = archive.read(library)
    assert content[:2] == b"MZ"
    assert function.encode() in content

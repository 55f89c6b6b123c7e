"""FMUs are valid, run in an importer, rebuild from their own sources, and give Python's numbers."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import Block, DataError, ModelError
from mckibben.blocks.base import Stream
from mckibben.blocks.laws import examples
from mckibben.exporting import export_fmu
from mckibben.exporting.fmu.unit import own_platform
from tests.export.building import SAMPLE_TIME
from tests.export.models import MODELS, difference, path_for, simulated
from tests.refusals import refused
from tests.tools import needs

Array = NDArray[np.float64]


def needs_compiler(test: Callable[..., None]) -> Callable[..., None]:
    platform = pytest.mark.skipif(own_platform() is None, reason="FMI knows no such platform")
    return needs("cc")(platform(test))


SHOWN = ("SDCHM inverse", pytest.param("pi-adaptive", marks=pytest.mark.long))


def exported(block: Block, folder: Path, **settings: Any) -> Path:
    path = folder / "muscle.fmu"
    return export_fmu(
        block,
        path,
        name="muscle",
        sample_time=SAMPLE_TIME,
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
@pytest.mark.parametrize("name", SHOWN)
def test_fmpy_gives_pythons_numbers(name: str, tmp_path: Path) -> None:
    block, inputs = MODELS[name], path_for(MODELS[name], 1, 150)
    outputs = through_fmpy(exported(block, tmp_path), block, inputs)
    assert difference(outputs, simulated(block, inputs)) <= 1e-12


@pytest.mark.parametrize("kind", examples())
def test_every_block_makes_a_valid_description(kind: str, tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation")
    path = exported(MODELS[kind], tmp_path, library=False)
    assert validation.validate_fmu(str(path)) == []


@pytest.mark.long
@needs_compiler
@needs("cmake")
def test_it_rebuilds_from_its_own_sources(tmp_path: Path) -> None:
    pytest.importorskip("fmpy")
    block, inputs = MODELS["SDCHM inverse"], path_for(MODELS["SDCHM inverse"], 1, 50)
    path = exported(block, tmp_path, library=False)
    with zipfile.ZipFile(path) as archive:
        assert not [entry for entry in archive.namelist() if entry.startswith("binaries")]
    command = [sys.executable, "-m", "fmpy", "compile", str(path), "--all-warnings"]
    subprocess.run([*command, "--warning-as-error"], check=True, capture_output=True)
    assert difference(through_fmpy(path, block, inputs), simulated(block, inputs)) <= 1e-12


@needs_compiler
def test_state_is_kept_and_restored(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    path, inputs = str(exported(MODELS["gpi"], tmp_path)), path_for(MODELS["gpi"], 1, 40)
    place, description = fmpy.extract(path), fmpy.read_model_description(path)
    unit = fmpy.instantiate_fmu(place, description, "CoSimulation")
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()

    def run(rows: Array, start: int) -> list[float]:
        found = []
        for k, row in enumerate(rows, start=start):
            unit.setReal([0], [row[0]])
            unit.doStep(k * SAMPLE_TIME, SAMPLE_TIME)
            found.append(unit.getReal([1])[0])
        return found

    run(inputs[:20], 0)
    saved = unit.getFMUstate()
    first = run(inputs[20:], 20)
    unit.setFMUstate(saved)
    unit.freeFMUstate(saved)
    assert run(inputs[20:], 20) == first
    unit.terminate()
    unit.freeInstance()
    shutil.rmtree(place)


@needs_compiler
def test_the_first_command_comes_before_the_first_step(tmp_path: Path) -> None:
    """From the initial inputs, and without a step of the model; the status is an output."""
    fmpy = pytest.importorskip("fmpy")
    block, inputs = MODELS["creep"], path_for(MODELS["creep"], 1, 40) + 1.0
    expected = simulated(block, inputs)
    path = str(exported(block, tmp_path))
    place, description = fmpy.extract(path), fmpy.read_model_description(path)
    outputs = [each.name for each in description.modelVariables if each.causality == "output"]
    assert outputs == ["displacement_output", "status"]
    unit = fmpy.instantiate_fmu(place, description, "CoSimulation")
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.setReal([0], [inputs[0, 0]])
    unit.exitInitializationMode()
    found = [unit.getReal([1])[0]]
    for k, (value,) in enumerate(inputs):
        unit.setReal([0], [value])
        unit.doStep(k * SAMPLE_TIME, SAMPLE_TIME)
        found.append(unit.getReal([1])[0])
        assert unit.getInteger([2]) == [Stream.GOOD]
    np.testing.assert_allclose(found, [expected[0, 0], *expected[:, 0]], rtol=1e-12)
    unit.setReal([0], [1e30])
    unit.doStep(len(inputs) * SAMPLE_TIME, SAMPLE_TIME)
    assert unit.getInteger([2]) == [Stream.BAD_INPUT]
    unit.terminate()
    unit.freeInstance()
    shutil.rmtree(place)


@needs_compiler
def test_communication_steps_may_be_longer_or_shorter_than_the_models(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    block = MODELS["creep"]
    path = exported(block, tmp_path)
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
    with refused(DataError, file=tmp_path / "model.zip"):
        export_fmu(block, tmp_path / "model.zip")
    with refused(ModelError, parameter="sample_time"):
        export_fmu(MODELS["creep"], tmp_path / "model.fmu", library=False)
    assert list(tmp_path.iterdir()) == []


def test_the_same_model_gives_the_same_bytes_and_a_file_stays(tmp_path: Path) -> None:
    path = exported(MODELS["SDCHM inverse"], tmp_path, library=False)
    before = path.read_bytes()
    exported(MODELS["SDCHM inverse"], tmp_path, library=False)
    assert path.read_bytes() == before
    path.write_bytes(b"mine")
    with pytest.raises(DataError) as refused:
        exported(MODELS["pi"], tmp_path, library=False)
    assert refused.value.file == path
    assert path.read_bytes() == b"mine"


def test_units_are_in_si(tmp_path: Path) -> None:
    path = exported(MODELS["per-channel"], tmp_path, library=False)
    with zipfile.ZipFile(path) as archive:
        tree = ElementTree.fromstring(archive.read("modelDescription.xml"))
    units = {unit.get("name"): unit.find("BaseUnit") for unit in tree.iter("Unit")}
    pressure, displacement = units["bar"], units["mm"]
    assert pressure is not None
    assert displacement is not None
    assert float(pressure.get("factor", "1")) == 1e5
    assert float(displacement.get("factor", "1")) == 1e-3

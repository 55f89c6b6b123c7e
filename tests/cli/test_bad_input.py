"""What a command cannot do leaves with code 2, a remedy that names it, and nothing written or lost."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from mckibben import Recording, write
from mckibben.outputs import results_in
from tests.cli.calls import files
from tests.cli.conftest import Cli
from tests.golden.commands import call
from tests.refusals import mentions

GOOD = "time_s,pressure_bar,displacement_mm\n" + "".join(
    f"{k / 10},{2 + k % 7},{k % 5}\n" for k in range(30)
)


@pytest.fixture(scope="module")
def stock(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with files of every kind, among them of several muscles and of a band."""
    folder = tmp_path_factory.mktemp("stock")
    files(folder)
    u = np.linspace(0, 3, 100)
    pressures = {f"pressure_{k}": np.sin(k * u) for k in (1, 2, 3)}
    moved = {f"displacement_{k}": 2 * np.sin(k * u) for k in (1, 2, 3)}
    write(Recording(pressures | moved, 0.1), folder / "three.csv")
    write(Recording({"pressure": u, "force": 2 * u}, 0.1), folder / "rest.csv")
    (folder / "empty").mkdir()
    (folder / "nan.csv").write_text(GOOD.replace("0.5,7,", "0.5,NaN,"))
    runs = ("run.csv", "two.csv", "--exchangeable", "run")
    assert call("calibrate", "model.json", *runs, "-o", "banded.json", folder=folder).code == 0
    return folder


@pytest.fixture
def folder(stock: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(stock, tmp_path / "copy")
    monkeypatch.chdir(tmp_path / "copy")
    return tmp_path / "copy"


FIT = "fit pi run.csv -o out.json"
PLAN = "plan run.csv -o out.csv"
RIG = "rig run rail -o out.csv"

BAD: list[tuple[str, str | tuple[object, ...]]] = [
    # Files
    ("fit pi nan.csv -o out.json", "nan.csv"),
    (f"{FIT} --column pressure=P9", "P9"),
    (f"{FIT} --rate 10", "run.csv"),
    ("fit pi run.csv run.csv -o out.json", "run.csv"),
    ("fit balance run.csv run.csv -o out.json", "run.csv"),
    ("fit pi model.json -o out.json", "model.json"),
    ("simulate run.csv model.json -o out.csv", "run.csv"),
    ("check run.csv model.json -o out", "run.csv"),
    ("check model.json none.csv -o out", "none.csv"),
    ("study empty -o out", "empty"),
    ("study run.csv -o run.csv", "run.csv"),
    ("fit pi run.csv -o nowhere/x.json", "nowhere"),
    ("plot run.csv -o out.bmp", "bmp"),
    # Models, settings and channels
    ("fit spline run.csv -o out.json", "'spline'"),
    (f"{FIT} --set n_operators=many", ("n_operators", "'many'")),
    (f"{FIT} --output temperature", "temperature"),
    (f"{FIT} --output pressure", "pressure"),
    (f"{FIT} --unit pressure", "--unit"),
    (f"{FIT} --constant force=g", "force=200"),
    (f"{FIT} --prior rail", "--prior"),
    ("fit balance run.csv --prior nobody -o out.json", "'nobody'"),
    ("fit coupled-pi three.csv -o out.json --set luck=1", "luck"),
    ("fit sdchm rest.csv -o out.json --output displacement_1", "displacement_1"),
    ("fit gpi three.csv -o out.json", "'gpi'"),
    ("fit force-balance three.csv -o out.json", "'balance'"),
    ("compare run.csv --models pi,what", "'what'"),
    ("compare three.csv --models grey-box", "'balance'"),
    ("study run.csv -o out --rig soft-arm", "--rig"),
    ("invert run.csv -o out.json", "run.csv"),
    ("invert model.json -o out.json --horizon 5", "--predictive"),
    ("invert pi.json --for force -o out.json", "'pi'"),
    ("plot run.csv -o out.png --kind pie", "pie"),
    ("info gpi", "--models"),
    ("info run.csv gpi", "--models"),
    # Bands
    ("simulate model.json run.csv -o out.csv --interval 0.9", "--interval"),
    ("simulate banded.json run.csv -o out.csv --interval 0.9", "66.7"),
    ("simulate banded.json run.csv -o out.csv --interval 1.5", "1.5"),
    ("invert banded.json -o out.json", "banded"),
    ("calibrate inverse.json run.csv -o out.json", "inverse"),
    ("calibrate model.json run.csv --fitted run.csv -o out.json", "run.csv"),
    # Plans
    (f"{PLAN} --limits pressure=4:1", "pressure"),
    (f"{PLAN} --limits pressure", "CHANNEL=LOW:HIGH"),
    (f"{PLAN} --limits torque=0:5", "torque"),
    (f"{PLAN} --minutes 0.01", "--minutes"),
    # Rigs
    ("track nowhere.json --rig soft-arm --reference run.csv", "nowhere.json"),
    ("track inverse.json --rig soft-arm --reference run.csv", "'soft-arm'"),
    ("rig show crane", "'crane'"),
    (RIG, "--inputs"),
    (f"{RIG} --signal sine:period=2 --inputs run.csv", "--inputs"),
    (f"{RIG} --signal wobble", "'wobble'"),
    (f"{RIG} --signal sine", "sine:period"),
    (f"{RIG} --signal sine:period=nan", ("sine:period", "nan")),
    (f"{RIG} --signal sine:tempo=1", "sine:tempo"),
    (f"{RIG} --signal pressure=sine:period=1", "'pressure'"),
    (f"{RIG} --signal sine:period=1 --set payload=-3", ("payload", -3)),
    ("rig record dance --out set", "'dance'"),
    ("rig record field-models --out set --only zz", "'zz'"),
]


@pytest.mark.parametrize(("words", "named"), BAD)
def test_bad_calls_leave_with_a_remedy(
    cli: Cli, folder: Path, words: str, named: str | tuple[object, ...]
) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    result = cli(*shlex.split(words))
    assert result.code == 2
    assert isinstance(named, tuple) or named in result.err
    assert not isinstance(named, tuple) or mentions(result.err, named)
    assert "Remedy:" in result.err or "Usage:" in result.err
    assert "Traceback" not in result.err
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_usage_errors_leave_with_two(cli: Cli) -> None:
    assert cli("fit").code == 2
    assert cli("frobnicate").code == 2
    assert cli("--help").code == 0


def test_a_defect_is_reported_without_a_traceback(
    cli: Cli, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*arguments: object, **settings: object) -> None:
        raise RuntimeError("of all things")

    monkeypatch.setattr("mckibben.files.read", broken)
    result = cli("characterize", "run.csv")
    assert result.code == 1
    assert "RuntimeError" in result.err
    assert "MCKIBBEN_DEBUG" in result.err
    assert "Traceback" not in result.err


@pytest.mark.parametrize(
    "words", ["compare run.csv --models pi", "study run.csv", "reproduce field-models"]
)
def test_two_do_not_write_to_one_folder(cli: Cli, folder: Path, words: str) -> None:
    out = folder / "empty"
    with results_in(out, []):
        result = cli(*shlex.split(words), "-o", out)
    assert result.code == 2
    assert str(out) in result.err
    assert not list(out.iterdir())

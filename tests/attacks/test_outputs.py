"""Outputs that would take the place of inputs or of strangers' files, planted names, full disks."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mckibben import GPI, Recording, write
from mckibben.comparison.kept import Kept
from mckibben.errors import DataError
from mckibben.outputs import MANIFEST, Results, is_figure
from mckibben.report import printed
from mckibben.report.drawing import Curve, Drawing, Panel
from mckibben.rigs import describe, load_rig
from mckibben.signals import triangle
from mckibben.system import manifest
from mckibben.system.atomic import PART, replacing, write_text
from tests.attacks.commands import call
from tests.tools import needs

MODEL, RUN, INVERSE, RIG = "model.json", "run.csv", "inverse.json", "rail.toml"

COMMANDS = {
    "simulate": (["simulate", MODEL, RUN, "-o"], [MODEL, RUN]),
    "fit": (["fit", "pi", RUN, "-o"], [RUN]),
    "fit several": (["fit", "coupled-pi", RUN, "--validation", "two.csv", "-o"], ["two.csv"]),
    "invert": (["invert", MODEL, "-o"], [MODEL]),
    "track": (
        ["track", INVERSE, "--rig", RIG, "--reference", RUN, "-o"],
        [INVERSE, RUN, RIG],
    ),
    "track, controller": (
        ["track", INVERSE, "--rig", RIG, "--reference", RUN, "--controller-out"],
        [INVERSE, RUN, RIG],
    ),
    "rig run": (["rig", "run", RIG, "--inputs", RUN, "-o"], [RIG, RUN]),
    "plot": (["plot", RUN, "--model", MODEL, "-o"], [MODEL, RUN]),
    "export c": (["export", "c", MODEL, "-o"], [MODEL]),
    "export fmu": (["export", "fmu", MODEL, "--platforms", "none", "-o"], [MODEL]),
}
"""Commands up to the output, and what they read."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one file of every kind, which is the current one."""
    monkeypatch.chdir(tmp_path)
    for name, peaks in ((RUN, [5.0, 4.0]), ("two.csv", [4.5, 3.5])):
        u = triangle(np.arange(0, 8, 0.02), 4.0, peaks)
        y = GPI.example().simulate(u)
        write(Recording({"pressure": u, "displacement": y}, 0.02), tmp_path / name)
    GPI.example().save(MODEL)
    GPI.example().inverse().save(INVERSE)
    Path(RIG).write_text(describe(load_rig("rail")))
    return tmp_path


def held(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def ending(command: str, given: str) -> str:
    """Return an ending that the command writes, so that it is not refused for that."""
    return {"plot": ".png", "simulate": ".csv", "rig run": ".csv", "track": ".csv"}.get(
        command, ".fmu" if command == "export fmu" else Path(given).suffix
    )


@pytest.mark.parametrize("way", ["itself", "another spelling", "a second name", "a link"])
@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_writes_over_what_it_reads(
    folder: Path,
    command: str,
    way: str,
) -> None:
    words, inputs = COMMANDS[command]
    for given in inputs:
        out = Path(given)
        if way == "another spelling":
            (folder / "sub").mkdir(exist_ok=True)
            out = Path("sub", "..", given)
        elif way != "itself":
            out = Path(f"second-{Path(given).stem}{ending(command, given)}")
            out.unlink(missing_ok=True)
            (os.link if way == "a second name" else os.symlink)(given, out)
        before = held(folder)
        for force in ((), ("--overwrite",) if "export" in command else ("--force",)):
            result = call(*words, out, *force)
            assert result.code == 2
            assert "Remedy:" in result.err
        assert held(folder) == before


@pytest.mark.skipif(
    not Path("/proc/self").is_dir(), reason="has no folder that nobody can write to"
)
@pytest.mark.parametrize("command", [each for each in COMMANDS if not each.startswith("export")])
def test_a_folder_that_cannot_be_written_to_is_refused_before_any_work(
    folder: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mckibben.files.read", None)
    result = call(*COMMANDS[command][0], f"/proc/mine{ending(command, MODEL)}")
    assert result.code == 2
    assert "it cannot be written" in result.err


@pytest.mark.parametrize(
    ("words", "out"),
    [
        (["simulate", MODEL, RUN, "-o"], "mine.csv"),
        (["fit", "pi", RUN, "-o"], "mine.json"),
        (["invert", MODEL, "-o"], "mine.json"),
        (["plot", RUN, "-o"], "mine.png"),
        (["rig", "run", "mas20-hanging", "--signal", "constant:value=1", "-o"], "mine.csv"),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_a_strangers_file_needs_force_and_ours_does_not(
    folder: Path,
    words: list[str],
    out: str,
) -> None:
    if words[0] == "rig":
        words = [*words[:-1], "--duration", "1", "-o"]
    (folder / out).write_text("mine\n")
    refused = call(*words, out)
    assert refused.code == 2
    assert "--force" in refused.err
    assert (folder / out).read_text() == "mine\n"
    assert call(*words, out, "--force").code == 0
    written = (folder / out).read_bytes()
    assert written != b"mine\n"
    assert call(*words, out).code == 0  # it is ours now


def test_what_we_wrote_and_its_user_changed_is_a_strangers(
    folder: Path,
) -> None:
    words = ["simulate", MODEL, RUN, "-o", "out.csv"]
    assert call(*words).code == 0
    changed = (folder / "out.csv").read_text() + "9,9,9,9\n"
    (folder / "out.csv").write_text(changed)
    assert call(*words).code == 2
    assert (folder / "out.csv").read_text() == changed


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_a_figure_that_its_user_changed_is_a_strangers(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"figure.{kind}"
    x = np.linspace(0, 1, 20)
    printed.save(Drawing((Panel("x", "y", (Curve(x, x, "a", "series-1"),), "a"),)), path)
    drawn = path.read_bytes()
    assert is_figure(path)
    n = len(drawn)
    for changed in (
        drawn + b"\n",
        drawn[:-1],
        drawn[: n // 2] + b"!" + drawn[n // 2 + 1 :],
        drawn[: n // 2] + b"more" + drawn[n // 2 :],
        b"a thesis on what was drawn by mckibben",
        drawn[:4],
    ):
        path.write_bytes(changed)
        assert not is_figure(path)
    if kind == "png":
        path.write_bytes(drawn)
        with Image.open(path) as image:
            image.load()
            assert "sha256" in image.info["Comment"]


def test_a_description_beside_the_output_is_guarded_too(
    folder: Path,
) -> None:
    beside = folder / "out.csv-metadata.json"
    beside.write_text('{"notes": "mine"}')
    result = call("simulate", MODEL, RUN, "-o", "out.csv")
    assert result.code == 2
    assert beside.read_text() == '{"notes": "mine"}'
    own = folder / "run.csv-metadata.json"
    before = own.read_bytes()
    result = call("fit", "pi", RUN, "-o", own, "--force")
    assert result.code == 2
    assert own.read_bytes() == before


def test_models_of_an_earlier_study_go_and_strangers_stay(
    folder: Path,
) -> None:
    words = ["study", RUN, "--test", "two.csv", "--jobs", "1", "-o", "out", "--models"]
    assert call(*words, "pi").code == 0
    out = folder / "out"
    shutil.copy(MODEL, out / "models" / "kept-by-hand.json")
    assert call(*words, "arx").code == 0
    assert sorted(path.name for path in (out / "models").iterdir()) == [
        "arx.json",
        "kept-by-hand.json",
    ]
    listed = manifest.read(out / MANIFEST)
    assert "models/arx.json" in listed
    assert "models/pi.json" not in listed
    assert all(manifest.holds(out / name, digests) for name, digests in listed.items())
    (out / "report.html").write_text("my own words")
    refused = call(*words, "pi")
    assert refused.code == 2
    assert (out / "report.html").read_text() == "my own words"
    assert (out / "models" / "arx.json").exists()


def test_results_are_not_written_over_recordings_in_the_same_folder(
    folder: Path,
) -> None:
    runs = folder / "runs"
    runs.mkdir()
    for name in ("a.csv", "leaderboard.csv"):
        shutil.copy(RUN, runs / name)
    before = (runs / "leaderboard.csv").read_bytes()
    for force in ((), ("--force",)):
        result = call("compare", "runs", "-o", "runs", "--models", "pi", *force)
        assert result.code == 2
        assert "leaderboard.csv" in result.err
    assert (runs / "leaderboard.csv").read_bytes() == before


def test_a_hostile_manifest_removes_nothing_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "pi.json").write_text("mine")
    out = tmp_path / "out"
    out.mkdir()
    (out / "models").symlink_to(tmp_path / "elsewhere")
    names = ("../mine", str(tmp_path / "mine"), "models/pi.json")
    (out / MANIFEST).write_text(manifest.lines({n: [manifest.digest(b"mine")] for n in names}))
    results = Results(out, force=True)
    results.clear()
    assert (tmp_path / "mine").exists()
    assert (tmp_path / "elsewhere" / "pi.json").exists()
    with pytest.raises(DataError, match="link"):
        results.write_text("models/pi.json", "new")


def test_digests_that_the_user_took_make_nothing_ours(folder: Path) -> None:
    out = folder / "out"
    out.mkdir()
    for name in ("thesis.csv", "report.html", "leaderboard.csv"):
        (out / name).write_text("mine")
    theirs = "".join(f"{manifest.digest(b'mine')}  {path.name}\n" for path in out.iterdir())
    (out / MANIFEST).write_text(theirs)
    before = held(out)
    words = ("compare", RUN, "--models", "pi", "--jobs", "1", "-o", "out")
    refused = call(*words)
    assert refused.code == 2
    assert MANIFEST in refused.err
    assert held(out) == before
    Results(out, force=True).clear()
    assert held(out) == before
    # in a manifest of ours, names that no command gives are somebody else's
    (out / MANIFEST).write_text(manifest.HEAD + theirs)
    Results(out).clear()
    assert sorted(path.name for path in out.iterdir()) == [MANIFEST, "thesis.csv"]


@needs("sha256sum")
def test_manifests_are_read_by_sha256sum(tmp_path: Path) -> None:
    Results(tmp_path).write_text("report.html", "new")
    check = ["sha256sum", "--check", "--strict", MANIFEST]
    assert subprocess.run(check, cwd=tmp_path, check=False, capture_output=True).returncode == 0


def test_a_folder_named_like_ours_keeps_what_somebody_else_put_there(tmp_path: Path) -> None:
    (tmp_path / "unfinished").mkdir()
    (tmp_path / "unfinished" / "thesis.json").write_text("mine")
    kept = Kept(tmp_path)
    kept.put("pi", GPI.example())
    assert len(list((tmp_path / "unfinished").iterdir())) == 2
    kept.clear()
    assert [path.name for path in (tmp_path / "unfinished").iterdir()] == ["thesis.json"]


def test_planted_links_are_not_written_through(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "victim").write_text("mine")
    for name in (f".out.{os.getpid()}.part", f"{PART}{'00' * 8}.part", "out"):
        (tmp_path / name).symlink_to(tmp_path / "victim")
    write_text(tmp_path / "out", "new")
    assert (tmp_path / "victim").read_text() == "mine"
    assert not (tmp_path / "out").is_symlink()
    assert (tmp_path / "out").read_text() == "new"
    monkeypatch.setattr("mckibben.system.atomic.secrets.token_hex", lambda n: "00" * n)
    with pytest.raises(DataError, match="File exists"):  # even if the name were guessed
        write_text(tmp_path / "out", "newer")
    assert (tmp_path / "victim").read_text() == "mine"


def test_rights_stay_and_devices_too(tmp_path: Path) -> None:
    path = tmp_path / "out"
    before = os.umask(0o027)
    try:
        write_text(path, "one")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640
    path.chmod(0o600)
    write_text(path, "two")
    assert path.stat().st_mode & 0o777 == 0o600
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError, match="pipe"):
        write_text(tmp_path / "pipe", "three")
    assert (tmp_path / "pipe").is_fifo()
    with pytest.raises(DataError, match="cannot be written"), replacing(path) as new:
        (new / "half").write_text("under a file")
    assert [p.name for p in sorted(tmp_path.iterdir())] == ["out", "pipe"]
    assert path.read_text() == "two"


FULL = [
    ["simulate", MODEL, RUN, "-o", "out.csv"],
    ["simulate", MODEL, RUN, "-o", "out.parquet"],
    ["fit", "pi", RUN, "-o", "out.json"],
    ["invert", MODEL, "-o", "out.json"],
    ["plot", RUN, "-o", "out.pdf"],
    ["rig", "run", RIG, "--signal", "constant:value=5", "--duration", "1", "-o", "out.csv"],
    ["export", "c", MODEL, "-o", "out"],
    ["export", "fmu", MODEL, "--platforms", "none", "-o", "out.fmu"],
    ["compare", RUN, "--models", "pi", "--jobs", "1", "-o", "out"],
]


def run_full(commands: list[list[str]], most: int) -> list[tuple[int, str]]:
    """Return code and words of commands in a process whose files may have only so many bytes."""
    code = (
        "import contextlib, io, json, sys\n"
        "from mckibben.cli.main import run\n"
        "for words in json.loads(sys.argv[1]):\n"
        "    sys.argv = ['mckibben', *words]\n"
        "    with contextlib.redirect_stderr(io.StringIO()) as said:\n"
        "        try: run()\n"
        "        except SystemExit as leaving: code = leaving.code\n"
        "    print(json.dumps([code, said.getvalue()]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(commands)],
        stdout=subprocess.PIPE,
        check=True,
        # Python would keep bytecode that is cut off, and all that come later would stumble over it
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
    )
    lines = [line for line in done.stdout.decode().splitlines() if line.startswith("[")]
    return [(found[0], found[1]) for found in map(json.loads, lines)]


def test_a_full_disk_is_told_with_the_file_that_was_not_written(folder: Path) -> None:
    before = held(folder)
    for words, (code, said) in zip(FULL, run_full(FULL, 200), strict=True):
        assert code == 2, (words, said)
        assert "out" in said.splitlines()[-1], (words, said)
        assert "File too large" in said, (words, said)
    assert held(folder) == before
    assert not list(folder.rglob("*.part"))
    assert {path.name for path in (folder / "out").rglob("*") if path.is_file()} <= {MANIFEST}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device is always full here")
@pytest.mark.parametrize("words", [["info", "--models"], ["--version"], ["info", RUN, "--json"]])
def test_full_standard_output_is_told(folder: Path, words: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "mckibben.cli.main", *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr.startswith("Standard output cannot be written to")
    assert len(done.stderr.splitlines()) == 1

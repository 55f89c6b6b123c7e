"""mckibben export: folders and files, and what becomes of bad requests and hostile models."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from mckibben.registry import load
from tests.attacks.commands import call
from tests.cli.conftest import Cli
from tests.tools import needs

needs_compiler = needs("cc")

HOSTILE = [
    "*/ int evil(void) { return 1; } /*",
    '"); system("true"); ("',
    "\\",
    "a\nint evil;",
    "??/",
    "<script>alert(1)</script>",
    "&evil;",
    "]]>",
    "{{ 7 * 7 }}",
    "%s%n",
    "// evil",
    "ü漢字",
    "",
]


def done(cli: Cli, *arguments: object) -> str:
    """Return what a command prints that has to succeed."""
    result = cli(*arguments)
    assert result.code == 0, result.err
    return result.out


def refused(cli: Cli, *arguments: object) -> str:
    """Return what a command prints that has to refuse bad input."""
    result = cli(*arguments)
    assert result.code == 2
    return result.err


def saved(kind: str, folder: Path) -> Path:
    path = folder / f"{kind}.json"
    load("blocks", kind).example().save(path)
    return path


@needs_compiler
@pytest.mark.parametrize("options", [[], ["--float32"], ["--inverse"]])
def test_a_folder_that_compiles_as_it_is(options: list[str], cli: Cli, tmp_path: Path) -> None:
    model = saved("gpi", tmp_path)
    result = done(cli, "export", "c", model, "-o", tmp_path / "out", "--check", "--json", *options)
    told = json.loads(result)
    assert told["name"] == "model_gpi"
    assert told["self_test"]
    assert {"README.md", "CMakeLists.txt", "library.properties", "model.json"} <= set(told["files"])
    assert (tmp_path / "out" / "examples" / "model_gpi" / "model_gpi.ino").is_file()


def test_the_same_model_gives_the_same_bytes(cli: Cli, tmp_path: Path) -> None:
    model = saved("series", tmp_path)
    for folder in ("a", "b"):
        done(cli, "export", "c", model, "-o", tmp_path / folder, "--name", "muscle")
    for path in sorted((tmp_path / "a").rglob("*")):
        if path.is_file():
            other = tmp_path / "b" / path.relative_to(tmp_path / "a")
            assert other.read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    "options",
    [
        *([], ["--sample-time", "0"], ["--sample-time", "nan"]),
        *(
            ["--sample-time", "1", "--name", name]
            for name in ("int", "a b", "x;system()", "mck_thing", "é", "a" * 50, "creep")
        ),
    ],
)
def test_bad_requests_write_nothing(options: list[str], cli: Cli, tmp_path: Path) -> None:
    error = refused(cli, "export", "c", saved("creep", tmp_path), "-o", tmp_path / "out", *options)
    assert "Remedy:" in error
    assert not options or options[-1] in error or options[1] in error
    assert not (tmp_path / "out").exists()


def test_what_was_changed_since_is_not_replaced(cli: Cli, tmp_path: Path) -> None:
    model, folder = saved("pi", tmp_path), tmp_path / "out"
    done(cli, "export", "c", model, "-o", folder, "--name", "first")
    sketch = folder / "examples" / "first" / "first.ino"
    sketch.write_text("mine")
    assert "out" in refused(cli, "export", "c", model, "-o", folder, "--name", "first")
    told = refused(cli, "export", "c", model, "-o", folder, "--name", "first", "--overwrite")
    assert "first.ino" in told
    assert sketch.read_text() == "mine"
    sketch.unlink()
    done(cli, "export", "c", model, "-o", folder, "--name", "first", "--overwrite", "--float32")
    assert "FLOAT32" in (folder / "src" / "mck_config.h").read_text()
    assert not list(tmp_path.glob(".*"))


@pytest.mark.long
@needs_compiler
@needs("cmake")
@pytest.mark.parametrize("name", ["test", "all", "help", "clean", "install", "m", "package"])
def test_names_that_builders_know_do_not_confuse_them(name: str, cli: Cli, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    done(cli, "export", "c", saved("pi", tmp_path), "-o", folder, "--name", name)
    for command in (["-S", folder, "-B", tmp_path / "b"], ["--build", tmp_path / "b"]):
        subprocess.run(["cmake", *map(str, command)], check=True, capture_output=True)
    subprocess.run(["ctest", "--test-dir", str(tmp_path / "b")], check=True, capture_output=True)


@pytest.mark.parametrize("name", ["math", "stdio", "unit", "unit_model", "fmi2"])
def test_names_of_headers_are_refused(name: str, cli: Cli, tmp_path: Path) -> None:
    model = saved("pi", tmp_path)
    for form, out in (("c", "out"), ("fmu", "out.fmu")):
        told = refused(cli, "export", form, model, "-o", tmp_path / out, "--name", name)
        assert name in told


def test_what_is_no_model_is_refused(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text('{"format": "mckibben-model", "version": 1, "kind": "pi"')
    for form, out in (("c", "out"), ("fmu", "out.fmu")):
        error = refused(cli, "export", form, tmp_path / "bad.json", "-o", tmp_path / out)
        assert "bad.json" in error
        assert not (tmp_path / out).exists()


def hostile(text: str, folder: Path) -> Path:
    """Return a saved model whose channels are named and measured by any text."""
    content: dict[str, Any] = load("blocks", "per-channel").example().to_dict()
    for part in content["parts"]:
        part["input"]["name"] += text
        part["input"]["unit"] = text
        part["output"]["name"] += text
    path = folder / "hostile.json"
    path.write_text(json.dumps(content))
    return path


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the export of the model whose names have nothing added."""
    folder = tmp_path_factory.mktemp("plain")
    done(call, "export", "c", hostile("", folder), "-o", folder / "out", "--name", "muscle")
    return folder / "out"


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_names_become_harmless_text(
    text: str, cli: Cli, plain: Path, tmp_path: Path
) -> None:
    """Whatever a model file calls its channels, comments stay comments and strings strings."""
    model = hostile(text, tmp_path)
    done(cli, "export", "c", model, "-o", tmp_path / "out", "--name", "muscle")
    for path in (tmp_path / "out").rglob("*.[chm]"):
        assert bare(path.read_text()) == bare(
            (plain / path.relative_to(tmp_path / "out")).read_text()
        )


@needs_compiler
def test_hostile_names_compile(cli: Cli, tmp_path: Path) -> None:
    model = hostile(" ".join(HOSTILE), tmp_path)
    done(cli, "export", "c", model, "-o", tmp_path / "out", "--check", "--name", "muscle")


def bare(source: str) -> str:
    """Return C or MATLAB without comments, and without the names that channels give to macros."""
    source = re.sub(r"/\*.*?\*/", "", source, flags=re.S)
    source = re.sub(r"#define MUSCLE_(IN|OUT)_\w+", "#define CHANNEL", source)
    return re.sub(r"^ *%.*$", "", source, flags=re.M)


@needs_compiler
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_hostile_names_make_valid_units(version: str, cli: Cli, tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation")
    out, model = tmp_path / "out.fmu", hostile(" ".join(HOSTILE), tmp_path)
    options = ["--fmi", version, "--platforms", "none", "--name", "muscle"]
    done(cli, "export", "fmu", model, "-o", out, *options)
    assert validation.validate_fmu(str(out)) == []


@needs_compiler
def test_an_fmu_from_the_command_line(cli: Cli, tmp_path: Path) -> None:
    out = tmp_path / "muscle.fmu"
    options = ["--platforms", "linux", "--inverse", "--json"]
    told = json.loads(done(cli, "export", "fmu", saved("pi", tmp_path), "-o", out, *options))
    assert told["libraries"] == ["binaries/linux64/model_pi.so"]
    error = refused(cli, "export", "fmu", saved("pi", tmp_path), "-o", tmp_path / "x.zip")
    assert ".fmu" in error

"""mckibben export: folders and files, and what becomes of bad requests and hostile models."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from mckibben.registry import load
from tests.cli.conftest import Cli
from tests.golden.commands import call
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
    assert told["name"] == "gpi"
    assert told["self_test"]
    assert {"README.md", "CMakeLists.txt", "library.properties", "model.json"} <= set(told["files"])
    assert (tmp_path / "out" / "examples" / "gpi" / "gpi.ino").is_file()


@pytest.mark.parametrize(
    "options",
    [
        *([], ["--sample-time", "0"], ["--sample-time", "nan"]),
        *(
            ["--sample-time", "1", "--name", name]
            for name in ("int", "a b", "x;system()", "mck_thing", "é", "a" * 50)
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
    assert sketch.read_text() == "mine"
    sketch.unlink()
    done(cli, "export", "c", model, "-o", folder, "--name", "first", "--float32")
    assert "FLOAT32" in (folder / "src" / "mck_config.h").read_text()
    assert not list(tmp_path.glob(".*"))


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


def test_hostile_names_make_a_valid_unit(cli: Cli, tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation")
    out, model = tmp_path / "out.fmu", hostile(" ".join(HOSTILE), tmp_path)
    options = ["--no-library", "--name", "muscle"]
    done(cli, "export", "fmu", model, "-o", out, *options)
    assert validation.validate_fmu(str(out)) == []

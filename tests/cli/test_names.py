"""Files of any name are read, fitted and reported: bytes that are no text, markup, dashes, lines."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from mckibben import read
from mckibben.printing import command, printable
from tests.cli.conftest import Cli

NAMES = {
    "no text": os.fsdecode(b"run\xff"),
    "a line break": "a\nNote: b",
    "quotes": "q'uo\"te `x` $(x) \\n",
    "markup": "<script>alert(1)<script>&amp;{{ 7 }}",
    "a format": "100%25 %s {0}",
    "a dash": "-dash",
    "letters": "日 \U0001f600",
    "controls": "\x1b[31m\u202ered",
    "a pattern": "b*?[1]",
}


@pytest.mark.parametrize("name", NAMES)
def test_a_file_of_any_name_works_to_the_end(
    cli: Cli, files: tuple[Path, Path], tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    train, test, made = (f"./{NAMES[name]}{end}" for end in (".csv", " test.csv", " made.csv"))
    for source, path in zip(files, (train, test), strict=True):
        shutil.copy(source, path)
        shutil.copy(f"{source}-metadata.json", f"{path}-metadata.json")
    quick = ["--models", "pi", "--jobs", 1]
    for words in (
        ["info", train],
        ["characterize", train],
        ["fit", "pi", train, "-o", "model.json"],
        ["simulate", "model.json", test, "-o", made],
        ["compare", train, "--test", test, *quick, "-o", "compared"],
        ["study", train, "--test", test, *quick, "-o", f"out{NAMES[name]}"],
    ):
        result = cli(*words)
        assert result.code == 0, result.err
        assert all(line.isprintable() for line in result.out.split("\n"))
        assert "\nNote: b" not in result.out
    assert len(json.loads(cli("info", train, "--json").out)) > 0
    out = tmp_path / f"out{NAMES[name]}"
    texts = {path.name: path.read_text("utf-8") for path in out.rglob("*.*") if path.is_file()}
    assert {"report.html", "leaderboard.json", "leaderboard.csv", "run.json"} <= texts.keys()
    assert "<script>alert" not in texts["report.html"]
    assert all(json.loads(text) for path, text in texts.items() if path.endswith(".json"))
    (recording,) = read(made)
    assert recording.source == str(Path(made))
    assert recording.name.isprintable()


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_a_command_has_one_line_and_the_same_words_in_a_shell() -> None:
    line = command(["printf", "%s\\0", *NAMES.values()])
    assert line.isprintable()
    said = subprocess.run(["bash", "-c", line], capture_output=True, check=True).stdout
    assert [os.fsdecode(word) for word in said.split(b"\0")[:-1]] == [*NAMES.values()]
    assert all(printable(each).isprintable() for each in NAMES.values())

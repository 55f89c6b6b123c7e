"""The bundled recordings, written anywhere, and never over a file of somebody's."""

from __future__ import annotations

from pathlib import Path

from mckibben import example
from mckibben.files import read
from tests.attacks.commands import call


def test_example_writes_what_is_bundled_and_repeats(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "examples"
    for _ in range(2):
        assert call("example", folder).code == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
        path.name: path.read_bytes() for path in example.files()
    }
    (train,) = read(folder / "decaying-triangle.csv")
    assert set(train.channels) == {"pressure", "displacement"}


def test_a_strangers_file_stays(tmp_path: Path) -> None:
    mine = tmp_path / "decaying-triangle.csv"
    mine.write_text("mine")
    refused = call("example", tmp_path)
    assert refused.code == 2
    assert "did not write" in refused.err
    assert mine.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [mine]
    assert call("example", tmp_path, "--force").code == 0
    assert mine.read_text() != "mine"

"""Pipes, devices, circles of links and files larger than allowed, wherever a file is opened."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from mckibben.errors import DataError
from mckibben.system import ordinary


def test_a_file_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert ordinary.read_bytes(path, most=5) == b"12345"
    assert ordinary.read_text(path, most=5) == "12345"
    with pytest.raises(DataError, match="5 bytes are more than the 4"):
        ordinary.read_bytes(path, most=4)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders here")
def test_a_pipe_is_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError, match="no ordinary file"):
        ordinary.read_bytes(tmp_path / "pipe", most=10)


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there are no devices here")
def test_a_device_is_refused(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("/dev/zero")
    with pytest.raises(DataError, match="no ordinary file"):
        ordinary.read_bytes(tmp_path / "link", most=10)


def test_circles_folders_and_what_is_missing_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for path, problem in (("a", "cannot be read"), ("", "folder"), ("none", "no such file")):
        with pytest.raises(DataError, match=problem):
            ordinary.read_bytes(tmp_path / path, most=10)
    with pytest.raises(DataError, match="cannot be read"):
        ordinary.read_bytes("a\0b", most=10)


def test_what_is_not_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"\xff")
    with pytest.raises(DataError, match="not text"):
        ordinary.read_text(tmp_path / "file", most=10)

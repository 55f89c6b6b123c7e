"""Tests that need what the README's line does not install are skipped without it."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from mckibben.export.c import emulation
from tests.tools import PACKAGES, needs, skip_without_tools, where

TESTS = Path(__file__).parents[1]


def test_no_test_looks_for_a_tool_by_itself() -> None:
    """What is skipped in any other way is not found again where the tool is there."""
    looking = re.compile(r"\bwhich\(|missing_tools\(")
    own = {Path(__file__), TESTS / "tools.py"}
    assert looking.search((TESTS / "tools.py").read_text(encoding="utf-8"))
    for path in set(TESTS.rglob("*.py")) - own:
        assert not looking.search(path.read_text(encoding="utf-8")), path


def test_a_tool_that_nothing_brings_is_refused() -> None:
    needs("clang")
    with pytest.raises(AssertionError, match="PACKAGES"):
        needs("clong")
    assert {emulation.COMPILER, emulation.SIZE, emulation.EMULATOR} <= PACKAGES.keys()


def test_what_lacks_a_tool_is_skipped(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    name = Path(sys.executable).name
    monkeypatch.setitem(PACKAGES, name, "")
    request.node.add_marker(needs(name))
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent))
    skip_without_tools(request.node)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(pytest.skip.Exception, match=f"there is no {name}"):
        skip_without_tools(request.node)
    assert where("libm.so.6") or sys.platform != "linux"
    assert where("libnowhere.so.6") is None

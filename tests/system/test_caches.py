"""Compiled functions are loaded as code: from no folder that others can write to."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from mckibben.system import caches

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="rights are others there")


def test_a_cache_that_others_can_write_to_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    (tmp_path / "own").mkdir()
    for mode in (0o777, 0o770):
        shared = tmp_path / f"shared-{mode:o}"
        shared.mkdir()
        shared.chmod(mode)
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(shared))
        with pytest.warns(caches.CacheWarning):
            assert caches.place.__wrapped__() == tmp_path / "own" / "mckibben"
    above = tmp_path / "shared-777" / "below"  # whoever may rename it can put another in its place
    above.mkdir(mode=0o700)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(above))
    with pytest.warns(caches.CacheWarning):
        assert caches.place.__wrapped__() == tmp_path / "own" / "mckibben"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "own" / "chosen"))
    assert caches.place.__wrapped__() == tmp_path / "own" / "chosen" / f"mckibben-{os.getuid()}"

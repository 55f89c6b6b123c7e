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


def test_others_do_not_get_into_a_cache_whatever_the_mask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, user = tmp_path / "given", os.getuid()
    given.mkdir(mode=0o755)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(given))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    before = os.umask(0)
    try:
        own = caches.place.__wrapped__()
        assert own == given / f"mckibben-{user}"
        assert own.stat().st_mode & 0o777 == 0o700
        (own / "below").mkdir()  # as numba does
        (own / "below" / "f.nbi").touch()
        assert caches.place.__wrapped__() == own
        own.chmod(0o755)  # others could write below until now
        with pytest.warns(caches.CacheWarning):
            assert caches.place.__wrapped__() == tmp_path / "mckibben"
        with pytest.warns(caches.CacheWarning):  # nor is it trusted later
            assert caches.place.__wrapped__() == tmp_path / "mckibben"
        (own / "below" / "f.nbi").unlink()
        (own / "below").rmdir()
        assert caches.place.__wrapped__() == own
        assert own.stat().st_mode & 0o777 == 0o700
        own.rmdir()
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        own.symlink_to(tmp_path / "elsewhere")  # which leads to another place tomorrow
        assert caches.place.__wrapped__() == tmp_path / "elsewhere"
    finally:
        os.umask(before)

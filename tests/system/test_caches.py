"""Users without a home, packages that cannot be written to, folders that others can write to.

Compiled functions are kept in a folder, and what lies there is loaded as code.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mckibben.system import caches

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="rights are others there")

NOBODY = 65534

BECOME = f"""
import ctypes, os
if os.getuid() == 0:  # nobody, who may read this interpreter wherever it lies, and write nothing
    libc = ctypes.CDLL(None, use_errno=True)
    assert libc.prctl(8, 1, 0, 0, 0) == 0  # keep what is permitted
    os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY})
    read = 1 << 2
    what = (ctypes.c_uint32 * 6)(read, read, 0, 0, 0, 0)
    assert libc.capset((ctypes.c_uint32 * 2)(0x20080522, 0), what) == 0
"""

RUN = """
import warnings
warnings.simplefilter("always")
from mckibben.system.compiling import deferred
import written
assert written.double(4.0) == 8.0
from mckibben.system.caches import place
print(place(), sum(written.double.dispatcher.stats.cache_hits.values()))
"""

WRITTEN = """
from mckibben.system.compiling import deferred

@deferred
def double(x):
    return 2.0 * x
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A function to compile that others cannot write to, and a place for what is temporary."""
    for name, mode in (("package", 0o755), ("tmp", 0o1777), ("work", 0o777)):
        (tmp_path / name).mkdir()
        (tmp_path / name).chmod(mode)
    (tmp_path / "package" / "written.py").write_text(WRITTEN)
    for above in (tmp_path, tmp_path.parent, tmp_path.parent.parent):
        above.chmod(0o755)  # the other user has to get there
    return tmp_path


def homeless(
    package: Path, code: str = RUN, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Python as a user who has neither a home nor rights."""
    kept = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
    path = f"{package / 'package'}{os.pathsep}{kept.get('PYTHONPATH', '')}"
    return subprocess.run(
        [sys.executable, "-B", "-c", BECOME + code],
        cwd=package / "work",
        env=kept
        | {"HOME": "/nonexistent", "TMPDIR": str(package / "tmp"), "PYTHONPATH": path}
        | environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.long
def test_without_a_home_compiled_functions_are_kept_among_the_temporary_files(
    package: Path,
) -> None:
    first = homeless(package)
    assert first.returncode == 0, first.stderr
    where, hits = first.stdout.split()
    assert Path(where).parent == package / "tmp"
    assert Path(where).stat().st_mode & 0o777 == 0o700
    assert hits == "0"
    assert first.stderr.count(where) == 1  # said once
    assert homeless(package).stdout.split() == [where, "1"]


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "linux" and os.getuid() != 0, reason="only root gives away")
def test_what_another_user_wrote_is_not_loaded(package: Path) -> None:
    trap = package / "tmp" / f"mckibben-{NOBODY}"
    trap.mkdir(mode=0o777)
    trap.chmod(0o777)
    done = homeless(package)  # the folder is root's
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[0] == "None"
    assert not list(trap.iterdir())


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

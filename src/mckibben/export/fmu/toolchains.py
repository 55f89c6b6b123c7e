"""Which shared libraries this machine can build: for itself, and for others by a cross-compiler."""

from __future__ import annotations

import importlib.util
import platform
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mckibben.errors import ModelError
from mckibben.export.programs import own_compiler, run

FLAGS = ("-std=c99", "-O2", "-s", "-ffp-contract=off", "-shared")


class Platform(NamedTuple):
    """A kind of machine that an FMU runs on: its folder in an FMU, its libraries, its target for zig."""

    folder: str
    suffix: str
    zig: str


PLATFORMS = {
    "linux": Platform("linux64", ".so", "x86_64-linux-gnu.2.17"),
    "windows": Platform("win64", ".dll", "x86_64-windows-gnu"),
    "macos": Platform("darwin64", ".dylib", "x86_64-macos"),
}
"""Those that FMI 2.0 has a folder for, by our name."""


def own_platform() -> str | None:
    """Return the name of the platform that this machine is, if it is one of them."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return None
    return {"linux": "linux", "win32": "windows", "darwin": "macos"}.get(sys.platform)


def buildable() -> list[str]:
    """Return the platforms that this machine can build for."""
    return [name for name in PLATFORMS if _command(name) is not None]


def _command(name: str) -> list[str] | None:
    """Return the start of a compiler's command line for a platform, or None."""
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS[name].zig]
    if name == own_platform():
        found = own_compiler()
        return [found] if found else None
    if name == "windows":
        mingw = shutil.which("x86_64-w64-mingw32-gcc")
        return [mingw, "-Wl,--no-insert-timestamp", "-static-libgcc"] if mingw else None
    return None


def build_library(name: str, folder: Path, sources: Sequence[str], out: Path) -> None:
    """Compile C files of a folder into a shared library for a platform.

    Raises
    ------
    ModelError
        If this machine cannot build for it, or the compiler refuses.
    """
    command = _command(name)
    if command is None:
        raise ModelError(
            f"this machine cannot build for {name}. Remedy: install a C compiler, or pip install "
            "'mckibben[cross]' for all platforms."
        )
    position = [] if PLATFORMS[name].suffix == ".dll" else ["-fPIC"]
    maths = [] if PLATFORMS[name].suffix != ".so" else ["-lm"]
    run(
        [*command, *FLAGS, *position, "-I.", *sources, *maths, "-o", str(out)],
        f"the FMU does not compile for {name}",
        folder=folder,
    )

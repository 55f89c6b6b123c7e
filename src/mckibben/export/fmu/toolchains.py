"""Which shared libraries this machine can build: for itself, and for others by a cross-compiler."""

from __future__ import annotations

import importlib.util
import platform
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mckibben.errors import ModelError
from mckibben.export.programs import own_compiler, run

FLAGS = ("-std=c99", "-O2", "-s", "-ffp-contract=off", "-shared")


@dataclass(frozen=True)
class Platform:
    """A kind of machine that an FMU runs on.

    Parameters
    ----------
    name : str
        Ours: system and processor.
    fmi2, fmi3 : str
        Folder of its library in an FMU.
    suffix : str
        Of the library.
    zig : str
        Target for the zig cross-compiler.
    """

    name: str
    fmi2: str
    fmi3: str
    suffix: str
    zig: str


PLATFORMS = {
    platform.name: platform
    for platform in (
        Platform("linux", "linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
        Platform("windows", "win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
        Platform("macos", "darwin64", "x86_64-darwin", ".dylib", "x86_64-macos"),
        Platform("macos-arm", "", "aarch64-darwin", ".dylib", "aarch64-macos"),
        Platform("linux-arm", "", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
    )
}
"""By name; those without a folder in FMI 2.0 are built for 3.0 only."""


def own_platform() -> str | None:
    """Return the name of the platform that this machine is, if it is one of them."""
    machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    return {
        ("linux", "x86_64"): "linux",
        ("linux", "aarch64"): "linux-arm",
        ("win32", "x86_64"): "windows",
        ("darwin", "x86_64"): "macos",
        ("darwin", "aarch64"): "macos-arm",
    }.get((sys.platform, machine))


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

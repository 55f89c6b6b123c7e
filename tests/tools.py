"""Programs that some tests need and the README's test line does not install.

A test says so by `needs`, and is skipped where the tool is not. ``python -m tests.tools install [TOOL
...]`` installs those named, or all, with apt-get where there is one.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence

import pytest

PACKAGES = {
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "arm-none-eabi-size": "binutils-arm-none-eabi",
    "cc": "g++",
    "chromium": "chromium",
    "clang": "clang libclang-rt-14-dev",
    "cmake": "cmake make",
    "cppcheck": "cppcheck",
    "g++": "g++",
    "gcc": "g++",
    "mkoctfile": "octave octave-dev",
    "octave-cli": "octave",
    "qemu-system-arm": "qemu-system-arm",
    "sha256sum": "coreutils",
}
"""Packages of Debian that bring each of them."""


def needs(tool: str) -> pytest.MarkDecorator:
    """Mark a test that needs a tool, which must be one of those that can be installed."""
    assert tool in PACKAGES, f"{tool}: say in PACKAGES what brings it"
    return pytest.mark.tool(name=tool)


def skip_without_tools(item: pytest.Item) -> None:
    """Skip a test whose tools are not here, and say which."""
    wanted = [mark.kwargs["name"] for mark in item.iter_markers("tool")]
    if lacking := sorted(tool for tool in wanted if shutil.which(tool) is None):
        pytest.skip(f"there is no {', '.join(lacking)}")


def install(tools: Sequence[str]) -> None:
    """Install tools of `PACKAGES`, with what they depend on; where that fails, tests are skipped."""
    packages = sorted(
        {*" ".join(PACKAGES[tool] for tool in tools if not shutil.which(tool)).split()}
    )
    if not packages or shutil.which("apt-get") is None:
        return
    asked = ["apt-get", "install", "-y", "-qq", "--no-install-recommends", *packages]
    for command in (["apt-get", "update", "-qq"], asked):
        if subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode:
            print(f"not installed, so that tests will be skipped: {' '.join(packages)}")
            return


if __name__ == "__main__":
    if sys.argv[1:2] != ["install"] or {*sys.argv[2:]} - PACKAGES.keys():
        sys.exit(f"python -m tests.tools install [{' | '.join(PACKAGES)}]")
    install(sys.argv[2:] or list(PACKAGES))

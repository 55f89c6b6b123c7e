"""Install and try a release everywhere: ``python -m tests.environments [3.11 ...]``.

The wheel and the source archive are each installed with the oldest libraries that the project allows and
with the newest, on each Python, in an environment of its own, and run the README's main job there, away
from the repository. Versions of Python that this machine lacks are named and left out. Needs uv.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.release import ROOT, build, main_job, run

RESOLUTIONS = ("lowest-direct", "highest")
"""What uv calls the oldest libraries, of those that the project names, and the newest."""

SHOWN = ("numpy", "scipy", "numba", "pandas", "pydantic", "pint")
"""Libraries whose versions are printed."""


def main(words: list[str]) -> None:
    """Try all environments, and end with an error if one fails."""
    uv = find_uv()
    pythons = {version: python_of(uv, version) for version in words or supported()}
    failed = []
    with tempfile.TemporaryDirectory() as place:
        archives = build(Path(place))
        for version, python in pythons.items():
            if python is None:
                print(f"Python {version}: left out, as this machine does not have it", flush=True)
                continue
            for archive in archives:
                for resolution in RESOLUTIONS:
                    name = f"Python {version}, {kind(archive)}, {resolution}"
                    try:
                        print(f"{name}: {attempt(uv, python, archive, resolution)}", flush=True)
                    except subprocess.CalledProcessError as error:
                        print(f"{name}: FAILED at {' '.join(map(str, error.cmd))}", flush=True)
                        failed.append(name)
    tried = any(pythons.values())
    sys.exit("; ".join(failed) or (None if tried else "no Python to try"))


def supported() -> list[str]:
    """Return the versions of Python that the project names."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return re.findall(r'"Programming Language :: Python :: (3\.\d+)"', text)


def find_uv() -> str:
    """Return the path of uv, beside this Python or on the path."""
    beside = Path(sys.executable).with_name("uv")
    found = str(beside) if beside.is_file() else shutil.which("uv")
    return found or sys.exit("uv is not installed")


def python_of(uv: str, version: str) -> str | None:
    """Return a Python of this machine, or nothing."""
    for folder in sorted(Path.home().glob(f".pyenv/versions/{version}.*"), reverse=True):
        if (python := folder / "bin" / "python").is_file():
            return str(python)
    command = (uv, "python", "find", "--no-project", "--no-python-downloads", version)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() or None


def kind(archive: Path) -> str:
    """Return what an archive is."""
    return "wheel" if archive.suffix == ".whl" else "source"


def attempt(uv: str, python: str, archive: Path, resolution: str) -> str:
    """Install an archive with the oldest or newest libraries, run the main job, and tell of it."""
    with tempfile.TemporaryDirectory() as place:
        folder, env, pins = Path(place), Path(place) / "env", Path(place) / "pins.txt"
        run(uv, "venv", "--quiet", "--python", python, str(env))
        inside = str(env / "bin" / "python")
        # the libraries are direct dependencies of the project, not of a line that names the archive
        chosen = ("--resolution", resolution, "--only-binary", ":all:")
        project = str(ROOT / "pyproject.toml")
        run(uv, "pip", "compile", "--quiet", *chosen, "--python", inside, project, "-o", str(pins))
        run(uv, "pip", "install", "--quiet", "--python", inside, str(archive), "-r", str(pins))
        started = time.perf_counter()
        for line in main_job():
            run(inside, "-m", "mckibben", *line, within=folder)
        if not (folder / "study" / "report.html").is_file():
            raise subprocess.CalledProcessError(1, ["mckibben", "study", "(no report)"])
        took = time.perf_counter() - started
        versions = dict(re.findall(r"^(\S+)==(\S+)", pins.read_text(encoding="utf-8"), re.M))
    told = ", ".join(f"{name} {versions[name]}" for name in SHOWN)
    return f"passed in {took:.0f} s ({told})"


if __name__ == "__main__":
    main(sys.argv[1:])

"""Set up this clone, and do a job: ``python3 start.py study`` or ``python3 start.py test``.

Needs Python 3.11 to 3.14 alone. What is set up is in ``.venv``; a second time takes a moment.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
PROGRAMS = ROOT / ".venv" / ("Scripts" if sys.platform == "win32" else "bin")

TRAIN, TEST = "examples/decaying-triangle.csv", "examples/irregular-triangle.csv"
STUDY = ("study", TRAIN, "--test", TEST, "--quick", "-o", "study")

JOBS = {
    "study": [("mckibben", "example"), ("mckibben", *STUDY)],
    "test": [("python", "-m", "pytest", "-n", "auto")],
}
"""What to run of the environment, by the word on the command line."""


def run(program: str | Path, *words: str) -> None:
    """Run a program in the clone; end with its code if it fails."""
    done = subprocess.run([program, *words], cwd=ROOT, check=False)
    if done.returncode:
        sys.exit(done.returncode)


def set_up() -> None:
    """Make the environment with all that the lock file names."""
    if not PROGRAMS.is_dir():
        run(sys.executable, "-m", "venv", ".venv")
    run(PROGRAMS / "python", "-m", "pip", "install", "--quiet", "uv")
    run(PROGRAMS / "uv", "sync", "--quiet", "--locked", "--inexact")


def main(words: list[str]) -> None:
    """Do the job that is named."""
    if len(words) != 1 or words[0] not in JOBS:
        sys.exit(f"usage: python3 start.py {'|'.join(JOBS)}")
    if not (3, 11) <= sys.version_info < (3, 15):
        sys.exit(f"Python 3.11 to 3.14 is needed, and this is {sys.version.split()[0]}")
    set_up()
    for program, *rest in JOBS[words[0]]:
        run(PROGRAMS / program, *rest)


if __name__ == "__main__":
    main(sys.argv[1:])

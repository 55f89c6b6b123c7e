"""Make all pages of measured recordings: python docs/measured/make.py FOLDER [PEERS].

FOLDER holds the public recordings named in src/mckibben/measured/known. In turn: every model on every
set (measured.md); the library of identified muscles (src/mckibben/muscles/library); how far forces at
held lengths repeat (repeats.txt); what priors from the library are worth (priors.txt); and, with the
Python of an environment that has the peers (benchmarks/peers.txt), theirs and our lines of the
leaderboard (leaderboard.csv, leaderboard.md). Takes about an hour on two cores.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent


def main() -> None:
    """Run all scripts in turn; finished parts of the first are stored if it is interrupted."""
    folder, *peers = sys.argv[1:]
    command = Path(sys.executable).with_name("mckibben")
    subprocess.run([command, "measured", folder, "-o", HERE, "--force"], check=True)
    subprocess.run([sys.executable, HERE / "library.py", folder], check=True)
    for name in ("repeats", "priors"):
        with (HERE / f"{name}.txt").open("w", encoding="utf-8") as file:
            subprocess.run([sys.executable, HERE / f"{name}.py", folder], check=True, stdout=file)
    with tempfile.TemporaryDirectory() as entries:
        for python in peers:
            script = ROOT / "benchmarks" / "peers.py"
            subprocess.run([python, script, folder, entries], check=True, cwd=ROOT)
    subprocess.run([sys.executable, HERE / "leaderboard.py"], check=True)


if __name__ == "__main__":
    main()

"""The bundled recordings: two runs of the virtual rig `mas20-hanging`, of the protocol `field-models`.

``mckibben rig record field-models -o FOLDER`` records them anew, to the bit. The package holds the steps
from sample to sample, in the resolution of the rig's sensors, which pack into a fifth.
"""

from __future__ import annotations

import lzma
import tempfile
from functools import cache
from itertools import accumulate
from pathlib import Path

from mckibben.outputs import claim
from mckibben.system.atomic import replacing, written
from mckibben.system.compiling import cache_folder

PACKED = Path(__file__).parent

NAMES = ("decaying-triangle.csv", "irregular-triangle.csv")


@cache
def _unpacked() -> Path:
    """Return a folder with the recordings, their descriptions, and ``protocol.json``."""
    folder = (cache_folder() or Path(tempfile.mkdtemp())) / "example"
    folder.mkdir(mode=0o700, exist_ok=True)
    contents = {path.name: path.read_bytes() for path in PACKED.glob("*.json")}
    for name, content in (contents | _tables()).items():
        path = folder / name
        if not path.is_file() or path.read_bytes() != content:
            with replacing(path) as new:
                new.write_bytes(content)
    return folder


def _tables() -> dict[str, bytes]:
    lines = lzma.decompress((PACKED / "steps.txt.xz").read_bytes()).decode().splitlines()
    counts = [list(accumulate(map(int, line.split()))) for line in lines]
    found = {}
    for name, pressures, displacements in zip(NAMES, counts[::2], counts[1::2], strict=True):
        rows = "".join(
            f"{round(0.02 * k, 2)},{round(0.0024 * p, 4)},{round(0.01 * d, 2)}\n"
            for k, (p, d) in enumerate(zip(pressures, displacements, strict=True))
        )
        found[name] = f"time,pressure,displacement\n{rows}".encode()
    return found


def __getattr__(name: str) -> Path:
    """Unpack the recordings when a path of one is asked for.

    ``TRAIN`` is to fit models to, and ``TEST`` to test them on: pressure [bar], displacement [mm].
    """
    if name == "FOLDER":
        return _unpacked()
    if name in ("TRAIN", "TEST"):
        return _unpacked() / NAMES[name == "TEST"]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def files() -> list[Path]:
    """Return the recordings, their descriptions, and ``protocol.json`` with their roles."""
    return sorted(path for path in _unpacked().iterdir() if path.suffix in (".csv", ".json"))


def copy_to(folder: Path, *, force: bool = False) -> int:
    """Copy all of them to a folder, created if missing, and return the number of files.

    Raises
    ------
    DataError
        Without ``force``, if another file has the name of one.
    """
    with written(folder):
        folder.mkdir(parents=True, exist_ok=True)
    contents = {folder / path.name: path.read_bytes() for path in files()}
    for path, content in contents.items():
        same = path.is_file() and not path.is_symlink() and path.read_bytes() == content
        claim(path, force=force or same)
    for path, content in contents.items():
        with replacing(path) as new:
            new.write_bytes(content)
    return len(contents)

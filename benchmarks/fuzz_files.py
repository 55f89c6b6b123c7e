"""Damage good files of every format, and see that reading them fails, if it does, on purpose.

    python benchmarks/fuzz_files.py --seconds 60 --seed 0

The good ones are those of the golden cases. What is neither read nor refused by an error of this
package, or takes more memory or time than `fuzzing` allows, is a finding.
"""

from __future__ import annotations

import random
import shutil
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path

import fuzzing
from mckibben import MckibbenError, read

FILES = Path(__file__).parents[1] / "tests/golden/files"
SINGLE = (FILES, FILES / "wrong")
"""Folders whose files are each a recording; any other folder is read as a whole."""

WORDS: tuple[bytes, ...] = (
    *(b"nan", b"inf", b"-1", b"1e308", b"1e-320", b"null", b"true", b"1.000,5", b"9" * 500),
    *(b"[[[[", b'{"a":', b"\n", b'"', b",", b";", b"%", b"#", b"_kPa", b"\xff\xfe"),
)
NUMBERS = (0, 1, 2, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1)

SEED = [0]


def damage(content: bytes, chance: random.Random) -> bytes:
    """Return a damaged copy: some bytes changed, moved, cut out or put in, or numbers made extreme."""
    made = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8, 30))):
        at = chance.randrange(len(made) + 1)
        size = min(chance.choice((1, 1, 2, 4, 4, 8, 8, 64)), len(made) - at)
        way = chance.randrange(7)
        if way == 0:
            made[at : at + size] = chance.randbytes(size)
        elif way == 1 and size:
            made[at] ^= 1 << chance.randrange(8)
        elif way == 2:
            number = chance.choice(NUMBERS)
            made[at : at + 4] = number.to_bytes(4, chance.choice(("little", "big")))
        elif way == 3:
            del made[at : at + size]
        elif way == 4:
            other = chance.randrange(len(made) + 1)
            made[at:at] = made[other : other + 8 * size]
        elif way == 5:
            made[at : at + size] = chance.choice(WORDS)
        elif chance.random() < 0.2:
            del made[at:]
    return bytes(made)


def asked_of(path: Path) -> Path:
    """Return what is read to read a file: itself, what it describes, or its folder."""
    if path.parent in SINGLE:
        return path.with_name(path.name.removesuffix("-metadata.json"))
    return FILES / path.relative_to(FILES).parts[0]


def reads(path: Path) -> bool:
    """Return whether a file is read as it is."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            read(asked_of(path))
        except MckibbenError:
            return False
    return True


GROUNDS = [path for path in sorted(FILES.rglob("*")) if path.is_file() and reads(path)]


def attempt(number: int) -> None:
    """Damage one file and read it, or the folder that it belongs to."""
    chance = random.Random(f"{SEED[0]} {number}")
    ground = chance.choice(GROUNDS)
    asked = asked_of(ground)
    with tempfile.TemporaryDirectory() as place, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if asked.is_dir():
            shutil.copytree(asked, Path(place) / asked.name)
            path = Path(place) / asked.name / ground.relative_to(asked)
        else:
            for companion in asked.parent.glob(f"{asked.name}*"):  # what describes it
                shutil.copy(companion, place)
            path = Path(place) / ground.name
        path.write_bytes(damage(path.read_bytes(), chance))
        with suppress(MckibbenError):
            read(Path(place) / asked.name)


if __name__ == "__main__":
    sys.exit(
        fuzzing.main(attempt, __doc__.splitlines()[0], seed=lambda seed: SEED.__setitem__(0, seed))
    )

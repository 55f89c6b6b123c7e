"""Damage good files of every format, and see that reading them fails, if it does, in words.

    python benchmarks/fuzz_files.py --seconds 60 --seed 0

Every file is read in a process of its own kind with bounded memory and time. What is neither read nor
refused by an error of this package, or takes more, is a failure: the line printed says how to run that
one again. The same seed makes the same files, in the same order.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import random
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

N = 60
TIME = np.arange(N) / 50
PRESSURE = 2 + np.sin(TIME * 9)
DISPLACEMENT = 10 - 3 * np.cos(TIME * 9)
COLUMNS = {"time_s": TIME, "pressure_bar": PRESSURE, "displacement_mm": DISPLACEMENT}

DESCRIBED = """
[time]
column = "time_s"
unit = "s"
[channels.pressure]
column = "pressure_bar"
unit = "psi"
gain = 2.5
offset = -1.25
[channels.force]
value = 1.962
unit = "N"
[[files]]
match = "*good*"
[files.channels.force]
value = 3.924
[split]
test = ["*.csv"]
"""

MOST_MEMORY = 600 * 2**20
MOST_SECONDS = 10.0
"""What one file may take."""

Maker = Callable[[Path], Path]
"""Writes a good file into a folder and returns the one to damage."""


def _text(name: str, separator: str) -> Maker:
    def make(folder: Path) -> Path:
        rows = [separator.join(COLUMNS), *(separator.join(map(repr, row)) for row in _rows())]
        (folder / name).write_text("\n".join(rows), encoding="utf-8")
        return folder / name

    return make


def _rows() -> list[tuple[float, ...]]:
    return list(zip(*(column.tolist() for column in COLUMNS.values()), strict=True))


def _own(name: str, damaged: str) -> Maker:
    def make(folder: Path) -> Path:
        from mckibben import Recording, write

        channels = {"pressure": PRESSURE, "displacement": DISPLACEMENT}
        write(Recording(channels, 0.02, meta={"load": {"mass": 10.0}}), folder / name)
        return folder / damaged

    return make


def _parquet(folder: Path) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    words = {"branch": ["up", "down"] * (N // 2), "at": TIME.astype("timedelta64[s]")}
    pq.write_table(pa.table({**COLUMNS, **words}), folder / "good.parquet")
    return folder / "good.parquet"


def _mat(packed: bool, version: str) -> Maker:
    def make(folder: Path) -> Path:
        from scipy.io import savemat

        inside = {"run": {**COLUMNS, "labels": np.array(["a", "b"], dtype=object)}}
        content = COLUMNS if version == "4" else {**inside, "other": PRESSURE, "note": "run 3"}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            savemat(folder / "good.mat", content, format=version, do_compression=packed)  # type: ignore[arg-type]
        made = folder / "good.mat"
        if version == "5":  # its head tells the time of day
            made.write_bytes(b"MATLAB 5.0 MAT-file".ljust(116) + made.read_bytes()[116:])
        return made

    return make


def _hdf5(name: str, userblock: int) -> Maker:
    def make(folder: Path) -> Path:
        import h5py

        with h5py.File(folder / name, "w", userblock_size=userblock) as file:
            file.attrs["rig"] = "bench 2"
            for key, values in COLUMNS.items():
                data = file.create_dataset(f"run/{key}", data=values, compression="gzip")
                data.attrs["units"] = key.rpartition("_")[2]
            file.create_dataset("plain", data=PRESSURE)
            file["soft"] = h5py.SoftLink("/plain")
        return folder / name

    return make


def _tdms(folder: Path) -> Path:
    from nptdms import ChannelObject, RootObject, TdmsWriter

    with TdmsWriter(folder / "good.tdms") as writer:
        for part in (slice(0, N // 2), slice(N // 2, N)):
            writer.write_segment(
                [RootObject({"operator": "jane"})]
                + [
                    ChannelObject("run", key, values[part], {"wf_increment": 0.02})
                    for key, values in COLUMNS.items()
                ]
            )
    return folder / "good.tdms"


def _xlsx(folder: Path) -> Path:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(["a run"])
    for row in (["time", *list(COLUMNS)[1:]], *_rows()):
        book.active.append(row)
    book.create_sheet("notes").append(["by", "Jane"])
    book.save(folder / "packed.xlsx")
    with (
        zipfile.ZipFile(folder / "packed.xlsx") as old,
        zipfile.ZipFile(folder / "good.xlsx", "w", zipfile.ZIP_STORED) as new,  # to be seen into
    ):
        for info in old.infolist():
            if info.filename != "docProps/core.xml":  # which tells the time of day
                new.writestr(zipfile.ZipInfo(info.filename), old.read(info))
    return folder / "good.xlsx"


def _bag(kind: str, packed: bool) -> Maker:
    def make(folder: Path) -> Path:
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2
        from rosbags.typesys import Stores, get_typestore

        ros1 = kind == "bag"
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
        path = folder / ("good.bag" if ros1 else "good")
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer: Any = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=plugin)
        if packed and ros1:
            writer.set_compression(Writer1.CompressionFormat.LZ4)
        elif packed:
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        name = "std_msgs/msg/Float64"
        serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
        with writer:
            for column, values in list(COLUMNS.items())[1:]:
                sent = writer.add_connection(f"/rig/{column}", name, typestore=store)
                for time_, value in zip(TIME, values, strict=True):
                    message = serialize(store.types[name](float(value)), name)
                    writer.write(sent, 10**9 + round(1e9 * time_), message)
        return path if ros1 else folder / "good" / f"good.{kind}"

    return make


def _described(folder: Path) -> Path:
    _text("good.csv", ",")(folder)
    (folder / "channels.toml").write_text(DESCRIBED, encoding="utf-8")
    return folder / "channels.toml"


def _signals(folder: Path) -> Path:
    rows = list(zip(TIME.tolist(), PRESSURE.tolist(), DISPLACEMENT.tolist(), strict=True))
    for place, name in ((1, "pressure_bar"), (2, "displacement_mm")):
        text = "".join(f"{row[0]!r},{row[place]!r}\n" for row in rows[:: 3 - place])
        (folder / f"{name}.csv").write_text(f"time_s,value\n{text}", encoding="utf-8")
    return folder / "pressure_bar.csv"


def _protocol(folder: Path) -> Path:
    _text("run.csv", ",")(folder)
    content = {"seed": 1, "runs": [{"name": "run", "file": "run.csv", "role": "test"}]}
    (folder / "protocol.json").write_text(json.dumps(content), encoding="utf-8")
    return folder / "protocol.json"


def _rig(folder: Path) -> Path:
    from mckibben.rigs import load_rig, save_rig

    save_rig(load_rig("mas20-hanging"), folder / "good.toml")
    return folder / "good.toml"


KINDS: dict[str, Maker] = {
    "csv": _text("good.csv", ","),
    "tsv": _text("good.tsv", "\t"),
    "own": _own("good.csv", "good.csv"),
    "sidecar": _own("good.csv", "good.csv-metadata.json"),
    "own-parquet": _own("good.parquet", "good.parquet"),
    "parquet": _parquet,
    "mat4": _mat(False, "4"),
    "mat5": _mat(False, "5"),
    "mat5-packed": _mat(True, "5"),
    "mat73": _hdf5("good.mat", 512),
    "hdf5": _hdf5("good.h5", 0),
    "tdms": _tdms,
    "xlsx": _xlsx,
    "bag": _bag("bag", False),
    "bag-packed": _bag("bag", True),
    "mcap": _bag("mcap", False),
    "mcap-packed": _bag("mcap", True),
    "db3": _bag("db3", False),
    "channels": _described,
    "signals": _signals,
    "protocol": _protocol,
    "rig": _rig,
}


def damage(content: bytes, chance: random.Random) -> bytes:
    """Return a damaged copy: some bytes changed, moved, cut out or put in, or numbers made extreme."""
    made = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8, 30))):
        at = chance.randrange(len(made) + 1)
        size = min(chance.choice((1, 1, 2, 4, 4, 8, 8, 64)), len(made) - at)
        way = chance.randrange(8)
        if way == 0:
            made[at : at + size] = chance.randbytes(size)
        elif way == 1 and size:
            made[at] ^= 1 << chance.randrange(8)
        elif way == 2:
            made[at : at + size] = chance.choice((b"\xff", b"\0", b"\x7f", b"9")) * size
        elif way == 3:
            number = chance.choice((0, 1, 2, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1, N * 2))
            made[at : at + 4] = number.to_bytes(4, chance.choice(("little", "big")))
        elif way == 4:
            del made[at : at + size]
        elif way == 5:
            other = chance.randrange(len(made) + 1)
            made[at:at] = made[other : other + 8 * size]
        elif way == 6:
            made[at : at + size] = chance.choice(WORDS)
        elif chance.random() < 0.2:
            del made[at:]
    return bytes(made)


WORDS: tuple[bytes, ...] = (
    *(b"nan", b"inf", b"-1", b"1e308", b"1e-320", b"null", b"true", b"1.000,5", b"9" * 5000),
    *(b"[[[[", b'{"a":', b"[" * 20_000, b"\n", b'"', b",", b";", b"%", b"#", b"_kPa", b"\xff\xfe"),
)


def _serve(pipe: Connection) -> None:
    """Read the files that are named, one after the other, and tell of each what came of it."""
    import resource

    from mckibben import MckibbenError, read
    from mckibben.files.folders import roles
    from mckibben.rigs import load_rig

    warnings.simplefilter("ignore")
    sys.setrecursionlimit(1000)
    for make in KINDS.values():  # what the libraries load counts for none of the files
        with tempfile.TemporaryDirectory() as place:
            path = make(Path(place))
            if path.suffix not in (".json", ".toml"):
                read(path)
    load_rig("mas20-hanging")
    sizes = Path("/proc/self/statm").read_text(encoding="ascii").split()
    room = int(sizes[0]) * resource.getpagesize() + MOST_MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (room, room))
    pipe.send("ready")
    while path := pipe.recv():
        try:
            if path.name == "channels.toml" or path.stem == "pressure_bar":
                read(path.parent)
            elif path.suffix == ".toml":
                load_rig(path)
            elif path.name == "protocol.json":
                roles(path.parent)
            else:
                read(path.with_name(path.name.removesuffix("-metadata.json")))
            pipe.send("read")
        except MckibbenError as error:
            pipe.send("more than is read" if "needs more memory" in str(error) else "refused")
        except BaseException as error:
            pipe.send(f"{type(error).__name__}: {str(error)[:200]}")


class Reader:
    """A process that reads files, begun anew when it dies or takes too long."""

    def __init__(self) -> None:
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None

    def read(self, path: Path) -> str:
        """Return what came of reading a file: ``read``, ``refused``, or what went wrong."""
        if self._process is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()
            self._pipe.recv()
        assert self._pipe is not None
        self._pipe.send(path)
        try:
            if self._pipe.poll(MOST_SECONDS):
                return str(self._pipe.recv())
            found = f"more than {MOST_SECONDS:g} s"
        except EOFError:
            self._process.join()
            found = f"the process died ({self._process.exitcode})"
        self.close()
        return found

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        self._process = None


def mutant(seed: int, number: int, folder: Path, kinds: Sequence[str]) -> tuple[str, Path]:
    """Write the damaged file of a number, and return its kind and path."""
    chance = random.Random(f"{seed} {number}")
    kind = kinds[number % len(kinds)]
    path = KINDS[kind](folder)
    path.write_bytes(damage(path.read_bytes(), chance))
    return kind, path


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--number", type=int, help="read that one file only, and say what came of it"
    )
    parser.add_argument("--kind", choices=KINDS, help="of files, instead of all in turn")
    parser.add_argument("--keep", type=Path, help="folder for the files that fail")
    chosen = parser.parse_args()
    kinds = [chosen.kind] if chosen.kind else list(KINDS)
    reader, counts, failures = Reader(), dict.fromkeys(("read", "refused"), 0), 0
    end = time.monotonic() + chosen.seconds if chosen.number is None else math.inf
    number = chosen.number or 0
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory() as place:
            kind, path = mutant(chosen.seed, number, Path(place), kinds)
            found = reader.read(path)
            if found in counts:
                counts[found] += 1
            else:
                failures += 1
                again = f"--seed {chosen.seed} --number {number}"
                again += f" --kind {chosen.kind}" if chosen.kind else ""
                print(
                    f"{kind}: {found}; again: python benchmarks/fuzz_files.py {again}", flush=True
                )
                if chosen.keep is not None:
                    chosen.keep.mkdir(parents=True, exist_ok=True)
                    kept = chosen.keep / f"{chosen.seed}-{number}-{path.name}"
                    kept.write_bytes(path.read_bytes())
        number += 1
        if chosen.number is not None:
            break
    reader.close()
    print(f"{counts['read']} files read, {counts['refused']} refused, {failures} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

"""Files of recordings that name other files, declare more than memory holds, or are no files at all.

Each hostile file is read in a process of its own, whose memory is measured.
"""

from __future__ import annotations

import io
import json
import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, MckibbenError
from mckibben.blocks.play_type.play import Play
from mckibben.comparison.kept import Kept
from mckibben.export.folders import write_folder
from mckibben.files import delimited, limits
from mckibben.files.folders import roles
from mckibben.rigs import load_rig
from tests.files import malformed

MOST_MB = 400
"""Of memory that any of these may take, beside what the libraries do."""

# Files that name others -----------------------------------------------------------------


def external(path: Path, target: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["time_s"] = np.arange(20.0)
        file.create_dataset("rig/pressure_bar", (20,), "u1", external=[(str(target), 0, 20)])


def virtual(path: Path, target: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["time_s"] = np.arange(20.0)
        layout = h5py.VirtualLayout((20,), "f8", maxshape=(None,))
        source = h5py.VirtualSource(str(target), "a", (20,), maxshape=(None,))
        layout[0 : h5py.h5s.UNLIMITED] = source[0 : h5py.h5s.UNLIMITED]
        file.create_virtual_dataset("rig/pressure_bar", layout)


@pytest.mark.parametrize("name", ["a.h5", "a.mat"])
@pytest.mark.parametrize("make", [external, virtual])
@pytest.mark.parametrize("target", ["secret", "pipe"])
def test_samples_in_another_file_are_refused(
    name: str, make: Callable[[Path, Path], None], target: str, tmp_path: Path
) -> None:
    (tmp_path / "secret").write_bytes(b"the words of another user")
    os.mkfifo(tmp_path / "pipe")  # opening it would wait for ever
    make(tmp_path / name, tmp_path / target)
    with pytest.raises(DataError, match="'rig/pressure_bar' keeps its samples in another file"):
        mckibben.read(tmp_path / name)


def test_links_do_not_lead_out_of_a_file_nor_round_in_it(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = np.arange(20.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["b"] = np.arange(20.0) ** 2
        file["again"] = file["b"]
        file["round"] = file["/"]
        file["out"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "a")
        file["soft"] = h5py.SoftLink("/out")
        for name, kind in (("r", h5py.ref_dtype), ("v", h5py.vlen_dtype("f8"))):
            file.create_dataset(name, (20,), kind)
        file.create_dataset("c", (20,), [("a", "f8"), ("b", "S5000")])
    (recording,) = mckibben.read(tmp_path / "a.h5")
    assert list(recording.channels) == ["again"]


# Files that declare too much ------------------------------------------------------------


def zeros_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("pressure_bar", (10**8,), "f8", chunks=(10**6,), compression="gzip")


def many_zeros_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for i in range(200):
            file.create_dataset(f"pressure_{i}", (10**6,), "f8")


def large_chunk_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("p", (20,), "f8", maxshape=(None,), chunks=(4 * 10**8,))


def overfull_chunk_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        data = file.create_dataset("p", (20,), "f8", chunks=(20,), compression="gzip")
        data.id.write_direct_chunk((0,), packed_zeros(10**9))


def damaged_chunk(content: bytes, mask: int = 0, **packing: Any) -> Callable[[Path], None]:
    """Return a maker of files with one chunk of 160 bytes that is this instead."""

    def make(path: Path) -> None:
        import h5py

        with h5py.File(path, "w") as file:
            data = file.create_dataset("p", (20,), "f8", chunks=(20,), **packing)
            data.id.write_direct_chunk((0,), content, filter_mask=mask)

    return make


def patched_scale_hdf5(path: Path) -> None:
    """Tell the filter of another number of samples than there is room for."""
    import h5py

    with h5py.File(path, "w") as file:
        data = file.create_dataset("p", data=np.full(20, 3), chunks=(20,), scaleoffset=0)
        said = struct.pack("<5I", *data.id.get_create_plist().get_filter(0)[2][:5])
    content = bytearray(path.read_bytes())
    struct.pack_into("<I", content, content.index(said) + 8, 2**28)
    path.write_bytes(content)


def short_hdf5(path: Path) -> None:
    """Say that there are more samples in one piece than were kept."""
    import h5py

    with h5py.File(path, "w") as file:
        file["p"] = np.arange(777.0)
    content = path.read_bytes()
    path.write_bytes(content.replace(struct.pack("<Q", 777), struct.pack("<Q", 7777)))


def wide_chunks_hdf5(path: Path) -> None:
    """Spread few samples over chunks that each unpack to many more."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("p", (2000, 1), "f8", chunks=(1, 5 * 10**4), maxshape=(None, None))


def deep_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        group: Any = file
        for _ in range(500):
            group = group.create_group("g")
        group["pressure_bar"] = np.arange(20.0)


def endless_heap_hdf5(path: Path) -> None:
    """Make HDF5 look for the end of a free piece of no length among the texts."""
    import h5py

    with h5py.File(path, "w") as file:
        file["pressure"] = np.arange(20.0)
        file["pressure"].attrs["units"] = "bar"
    content = bytearray(path.read_bytes())
    free = content.index(b"GCOL") + 16 + 16 + 8  # behind the collection's head, and one text
    content[free : free + 16] = bytes(16)
    path.write_bytes(content)


def disguised_heap_hdf5(path: Path) -> None:
    """The same, with something in bytes that are kept for later versions."""
    endless_heap_hdf5(path)
    content = bytearray(path.read_bytes())
    content[content.index(b"GCOL") + 5] = 1
    path.write_bytes(content)


def narrow_heap_hdf5(path: Path) -> None:
    """The same again, where lengths have four bytes, and what is behind them nobody reads."""
    import h5py

    about = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    about.set_sizes(4, 4)
    with h5py.File(h5py.h5f.create(bytes(path), h5py.h5f.ACC_TRUNC, fcpl=about)) as file:
        file["pressure"] = np.arange(20.0)
        file["pressure"].attrs["units"] = "bar"
    content = bytearray(path.read_bytes())
    free = content.index(b"GCOL") + 16 + 16 + 8
    content[free : free + 16] = bytes(12) + b"\1\0\0\0"
    path.write_bytes(content)


def many_heaps_hdf5(path: Path) -> None:
    """Let what looks like heaps begin everywhere within each other."""
    import h5py

    one = b"GCOL\1\0\0\0" + struct.pack("<QHHIQ", 10**5, 1, 1, 0, 16)
    with h5py.File(path, "w") as file:
        file["pressure_bar"] = np.frombuffer(one * 12_500, "f8")


def endless_room_hdf5(path: Path) -> None:
    """Let a piece of free room among the names lead to itself."""
    import h5py

    with h5py.File(path, "w") as file:
        file["pressure"] = np.arange(20.0)
    content = bytearray(path.read_bytes())
    free, at = struct.unpack_from("<QQ", content, content.index(b"HEAP") + 16)
    struct.pack_into("<Q", content, at + free, free)
    path.write_bytes(content)


def indexed(path: Path) -> tuple[bytearray, int, bytes]:
    """Write a vector of 70 chunks; return the file, where its index begins, and that as it is."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("pressure_bar", data=np.arange(70.0), chunks=(1,))
    content = bytearray(path.read_bytes())
    top = content.index(b"TREE\1\1")
    return content, top, bytes(content[top : top + 24 + 65 * 32])


def returning_index_hdf5(path: Path) -> None:
    """Let an index be below itself."""
    content, top, _ = indexed(path)
    struct.pack_into("<Q", content, top + 48, top)
    path.write_bytes(content)


def repeating_index_hdf5(path: Path) -> None:
    """Let each of six nodes name the next many times."""
    content, top, node = indexed(path)
    (below,) = struct.unpack_from("<Q", node, 48)
    key = struct.pack("<IIQQ", 8, 0, 0, 0)
    for level in range(1, 7):
        head = b"TREE\1" + struct.pack("<BHqq", level, 64, -1, -1)
        at = len(content) if level < 6 else top
        node = head + (key + struct.pack("<Q", below)) * 64 + key
        content[at : at + len(node)] = node
        below = at
    struct.pack_into("<Q", content, 40, len(content))
    path.write_bytes(content)


def long_places_hdf5(path: Path) -> None:
    """Keep many vectors behind long names, each of which has those in its place."""
    import h5py

    with h5py.File(path, "w") as file:
        group: Any = file
        for _ in range(20):
            group = group.create_group("g" * 50_000)
        for i in range(1000):
            group[str(i)] = np.arange(20.0)


def nested_type_hdf5(path: Path) -> None:
    """Let a type be of types, thousands deep, which are copied for each other."""
    import h5py

    kind = h5py.h5t.IEEE_F64LE
    for _ in range(1600):
        kind = h5py.h5t.vlen_create(kind)
    with h5py.File(path, "w", libver="latest") as file:
        file["pressure_bar"] = np.arange(20.0)
        h5py.h5d.create(file.id, b"p", kind, h5py.h5s.create_simple((20,)))


def packed_heap_hdf5(path: Path) -> None:
    """Say of the names in a group that they are packed."""
    import h5py

    with h5py.File(path, "w", libver="latest") as file:
        for i in range(20):
            file[f"a{i}"] = np.arange(20.0)
    content = bytearray(path.read_bytes())
    content[content.index(b"FRHP") + 7] = 30
    path.write_bytes(content)


def many_links_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["a"] = np.arange(20.0)
        for i in range(limits.MOST_PARTS):
            file.id.links.create_hard(b"a%d" % i, file.id, b"a")


def zeros_parquet(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({"pressure_bar": np.zeros(2 * 10**6)})
    with pq.ParquetWriter(path, table.schema, compression="zstd") as writer:
        for _ in range(10):
            writer.write_table(table)


def wrong_pages_parquet(path: Path) -> None:
    """Say of pages that they unpack to less than nothing."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({name: np.zeros(2000) for name in "abc"})
    pq.write_table(table, path, compression="zstd", use_dictionary=False)
    content, group = bytearray(path.read_bytes()), pq.read_metadata(path).row_group(0)
    for i in range(3):
        size = group.column(i).data_page_offset + 3  # behind the type, and the mark of a size
        assert content[size - 1] == 0x15
        assert content[size + 3] == 0x15
        content[size : size + 3] = b"\xff\xff\x7f"
    path.write_bytes(content)


def page_before_parquet(path: Path, *, kind: int = 1, name: str = "pressure_bar") -> None:
    """Put a page before those of samples, of a kind that has none but says that it has all.

    The one behind it unpacks to zeros without end.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    n, size = 4000, 2**29
    many = pa.Codec("zstd").compress(bytes(size)).to_pybytes()
    few = pa.Codec("zstd").compress(bytes(16)).to_pybytes()
    about = (5, 12, thrift((1, 5, whole(n)), (2, 5, whole(0)), *LEVELS))

    def page(of: int, holding: int, packed: bytes) -> bytes:
        sizes = (2, 5, whole(holding)), (3, 5, whole(len(packed)))
        return thrift((1, 5, whole(of)), *sizes, about) + packed

    pages = (page(kind, 16, few) if kind else b"") + page(0, size, many)
    table = pa.table({"time_s": np.arange(n) * 1.0, name: np.random.default_rng(1).random(n)})
    pq.write_table(table, path, compression="zstd", use_dictionary=False, write_statistics=False)
    content, column = bytearray(path.read_bytes()), pq.read_metadata(path).row_group(0).column(1)
    at = column.data_page_offset
    assert len(pages) < column.total_compressed_size
    content[at : at + len(pages)] = pages
    path.write_bytes(content)


def many_fields_parquet(path: Path) -> None:
    """Describe a file by fields that nobody knows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"pressure_bar": np.arange(20.0)}), path)
    content = path.read_bytes()
    size = int.from_bytes(content[-8:-4], "little")
    about = content[-8 - size : -9]  # without its end
    about += b"\x09" + unsigned(200) + b"\xfc" + unsigned(200) + (b"\x11" * 30_000 + b"\0") * 200
    path.write_bytes(
        content[: -8 - size] + about + b"\0" + struct.pack("<I", len(about) + 1) + b"PAR1"
    )


def packed_zeros(n: int) -> bytes:
    """Return zeros as zlib packs them; those in the middle are copies of what stands before."""
    packing = zlib.compressobj(1)
    start = packing.compress(bytes(10**6)) + packing.flush(zlib.Z_FULL_FLUSH)
    more = packing.compress(bytes(10**6)) + packing.flush(zlib.Z_FULL_FLUSH)
    return start + more * (n // 10**6 - 1) + b"\3\0"


MAT = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def head(of: int, name: bytes, *shape: int) -> bytes:
    dimensions = struct.pack(f"<{len(shape)}i", *shape)
    return element(6, struct.pack("<II", of, 0)) + element(5, dimensions) + element(1, name)


def zeros_mat(path: Path) -> None:
    path.write_bytes(MAT + element(15, packed_zeros(10**9)))


def exact_mat(path: Path) -> None:
    """Use up what may be unpacked to the last byte, and go on."""
    size = 8 * limits.FREE_SAMPLES
    first = struct.pack("<II", 14, size - 8) + element(6, struct.pack("<II", 16, 0))
    packing = zlib.compressobj(1)
    packed = packing.compress(first + bytes(size - len(first))) + packing.flush()
    tag = struct.pack("<II", 15, len(packed))  # what is packed is not padded
    path.write_bytes(MAT + tag + packed + element(15, packed_zeros(10**9)))


def many_fields_mat(path: Path) -> None:
    n = limits.MOST_PARTS + 1
    about = head(2, b"s", 1, 1) + element(5, struct.pack("<i", 1)) + element(1, b"a" * n)
    path.write_bytes(MAT + element(14, about + struct.pack("<II", 14, 0) * n))


def packed_mat(path: Path, content: bytes) -> None:
    packed = zlib.compress(element(14, content), 1)
    path.write_bytes(MAT + struct.pack("<II", 15, len(packed)) + packed)


def many_axes_mat(path: Path) -> None:
    """Multiply a million sizes."""
    shape = element(5, b"\xff\xff\xff\x7f" * 10**6)
    packed_mat(path, element(6, struct.pack("<II", 6, 0)) + shape + element(1, b"p"))


def many_flags_mat(path: Path) -> None:
    packed_mat(path, element(6, bytes(7 * 10**7)) + element(5, bytes(8)) + element(1, b"p"))


def long_places_mat(path: Path) -> None:
    """Give the many fields of a struct places with its long name in them."""
    n = 2000
    names = b"".join(b"%07d\0" % i for i in range(n))
    fields = element(14, head(6, b"", 1, 20) + element(9, bytes(160))) * n
    about = head(2, b"x" * 10**6, 1, 1) + element(5, struct.pack("<i", 8)) + element(1, names)
    packed_mat(path, about + fields)


def many_letters_mat(path: Path) -> None:
    n = 7 * 10**7
    packed_mat(path, head(4, b"t", n, 1) + element(1, b"a" * n))


def many_words_mat(path: Path) -> None:
    """Have a word for each letter."""
    n = 9 * 10**6
    packed_mat(path, head(4, b"t", n, 1) + element(4, b"\x00\x4e" * n))


def returning_mat(path: Path) -> None:
    """Lead from a variable of version 4 to itself, by a size that is negative."""
    path.write_bytes(struct.pack("<iiiii", 0, -1, 3, 0, 4) + b"abc\0" + bytes(200))


def bytes_for_doubles_mat(path: Path) -> None:
    """MATLAB keeps doubles that are whole numbers as bytes."""
    packing = zlib.compressobj(1)
    numbers = element(14, head(6, b"p", 1, 3 * 10**7) + element(2, bytes(3 * 10**7)))
    path.write_bytes(MAT + element(15, packing.compress(numbers) + packing.flush()))


def deep_mat(path: Path) -> None:
    inner = head(6, b"", 1, 3) + element(9, bytes(24))
    for _ in range(2000):
        inner = head(1, b"", 1, 1) + element(14, inner)
    path.write_bytes(MAT + element(14, head(1, b"x", 1, 1) + element(14, inner)))


def segment(objects: list[bytes], data: bytes, contents: int) -> bytes:
    about = struct.pack("<I", len(objects)) + b"".join(objects) if contents & 2 else b""
    sizes = struct.pack("<QQ", len(about) + len(data), len(about))
    return b"TDSm" + struct.pack("<II", contents, 4713) + sizes + about + data


def channel(name: str, n: int, kind: int = 10) -> bytes:
    place = f"/'run'/'{name}'".encode()
    about = struct.pack("<IIIQ", 20, kind, 1, n)
    return struct.pack("<I", len(place)) + place + about + struct.pack("<I", 0)


def declared_tdms(path: Path) -> None:
    path.write_bytes(segment([channel("p", 10**15)], bytes(80), 14))


def shredded_tdms(path: Path) -> None:
    many = segment([channel(f"c{i}", 1) for i in range(300)], bytes(2400), 14)
    path.write_bytes(many + segment([], bytes(2400), 8) * 2000)


REFUSED: dict[str, tuple[Callable[[Path], None], str]] = {
    "zeros.h5": (zeros_hdf5, "none were measured"),
    "many_zeros.h5": (many_zeros_hdf5, "none were measured"),
    "large_chunk.h5": (large_chunk_hdf5, "declares 400000000 samples"),
    "overfull_chunk.h5": (overfull_chunk_hdf5, "less closely than it says"),
    "few.h5": (damaged_chunk(zlib.compress(bytes(16)), compression="gzip"), "less closely"),
    "tail.h5": (
        damaged_chunk(zlib.compress(bytes(160)) + b"x", compression="gzip"),
        "less closely",
    ),
    "bare.h5": (damaged_chunk(bytes(16)), "less closely"),
    "masked.h5": (damaged_chunk(bytes(16), 1, compression="gzip"), "less closely"),
    "shuffled.h5": (damaged_chunk(bytes(16), shuffle=True), "less closely"),
    "checked.h5": (damaged_chunk(bytes(160), fletcher32=True), "less closely"),
    "lzf.h5": (damaged_chunk(b"\3abcd", compression="lzf"), "only deflate, shuffle and fletcher32"),
    "scaled.h5": (patched_scale_hdf5, "only deflate, shuffle and fletcher32"),
    "short.h5": (short_hdf5, "Remedy"),
    "wide_chunks.h5": (wide_chunks_hdf5, "none were measured"),
    "deep.h5": (deep_hdf5, "nested more than"),
    "endless.h5": (endless_heap_hdf5, "have no end"),
    "disguised.h5": (disguised_heap_hdf5, "have no end"),
    "narrow.h5": (narrow_heap_hdf5, "other than eight bytes"),
    "many_heaps.h5": (many_heaps_hdf5, "have no end"),
    "room.h5": (endless_room_hdf5, "have no end"),
    "returning.h5": (returning_index_hdf5, "leads back"),
    "repeating.h5": (repeating_index_hdf5, "have no end"),
    "long_places.h5": (long_places_hdf5, "more than 4096 characters"),
    "nested.h5": (nested_type_hdf5, "read"),
    "packed_heap.h5": (packed_heap_hdf5, "are packed"),
    "many_links.h5": (many_links_hdf5, "more than 10000 parts"),
    "zeros.parquet": (zeros_parquet, "none were measured"),
    "wrong_pages.parquet": (wrong_pages_parquet, "a page is longer than its column"),
    "page.parquet": (page_before_parquet, "unpack to more"),
    "words.parquet": (partial(page_before_parquet, kind=2), "damaged"),
    "dot.parquet": (partial(page_before_parquet, kind=0, name="pressure.bar"), "unpack to more"),
    "many_fields.parquet": (many_fields_parquet, "too many fields"),
    "zeros.mat": (zeros_mat, "none were measured"),
    "exact.mat": (exact_mat, "none were measured"),
    "many_fields.mat": (many_fields_mat, "more than 10000 parts"),
    "many_axes.mat": (many_axes_mat, "more than 32 axes"),
    "many_flags.mat": (many_flags_mat, "more than 32 axes"),
    "long_places.mat": (long_places_mat, "more than 4096 characters"),
    "many_letters.mat": (many_letters_mat, "none were measured"),
    "many_words.mat": (many_words_mat, "none were measured"),
    "returning.mat": (returning_mat, "is damaged"),
    "bytes.mat": (bytes_for_doubles_mat, "none were measured"),
    "deep.mat": (deep_mat, "nested more than"),
    "declared.tdms": (declared_tdms, "it cannot be read"),
    "shredded.tdms": (shredded_tdms, "scattered"),
}

CHILD = """
import resource, sys, warnings
import h5py, mckibben, nptdms, pyarrow.parquet, scipy.io
warnings.simplefilter("ignore")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for path in sys.argv[1:]:
    try:
        mckibben.read(path)
        print("read")
    except mckibben.MckibbenError as error:
        print(str(error).replace(path, ""))
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


def read_apart(*paths: Path) -> tuple[list[str], int]:
    """Return what came of each file, and the megabytes that reading took at most."""
    found = subprocess.run(
        [sys.executable, "-c", CHILD, *map(str, paths)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    *said, memory = found.stdout.splitlines()
    return said, int(memory)


def test_what_declares_too_much_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    for name, (make, _) in REFUSED.items():
        make(tmp_path / name)
    said, memory = read_apart(*(tmp_path / name for name in REFUSED))
    for line, (name, (_, problem)) in zip(said, REFUSED.items(), strict=True):
        assert problem in line, name
        assert len(line) < 600
    assert memory < MOST_MB


def thrift(*fields: tuple[int, int, bytes]) -> bytes:
    """Return a struct in Thrift's compact protocol, of fields by number, type and content."""
    last, content = 0, b""
    for number, kind, value in fields:
        content += bytes([number - last << 4 | kind]) + value
        last = number
    return content + b"\0"


def whole(n: int) -> bytes:
    """Return a number that is not negative, as Thrift has those with a sign."""
    return unsigned(2 * n)


def unsigned(n: int) -> bytes:
    more = b""
    while n > 127:
        more, n = more + bytes([n & 127 | 128]), n >> 7
    return more + bytes([n])


def listed(kind: int, *items: bytes) -> bytes:
    return bytes([len(items) << 4 | kind]) + b"".join(items)


def page_bomb(path: Path, size: int, dictionary: bool) -> None:
    """Write twenty samples whose one page, or dictionary, unpacks to so many zeros."""
    import pyarrow as pa

    sink = pa.BufferOutputStream()
    with pa.CompressedOutputStream(sink, "zstd") as packing:
        for _ in range(size >> 20):
            packing.write(bytes(2**20))
    packed, n = sink.getvalue().to_pybytes(), 20
    about = (1, 5, whole(size // 8 if dictionary else n)), (2, 5, whole(0))
    kind = (7, 12, thrift(*about)) if dictionary else (5, 12, thrift(*about, *LEVELS))
    head = (1, 5, whole(2 if dictionary else 0)), (2, 5, whole(size)), (3, 5, whole(len(packed)))
    pages = [thrift(*head, kind) + packed]
    if dictionary:
        places = pa.Codec("zstd").compress(b"\1" + unsigned(2 * n) + b"\0").to_pybytes()
        held = (1, 5, whole(n)), (2, 5, whole(8)), *LEVELS
        sizes = (2, 5, whole(4 - 1)), (3, 5, whole(len(places)))
        pages.append(thrift((1, 5, whole(0)), *sizes, (5, 12, thrift(*held))) + places)
    length, name = sum(map(len, pages)), unsigned(12) + b"pressure_bar"
    column = [
        (1, 5, whole(5)),
        (2, 9, listed(5, whole(0), whole(8))),
        (3, 9, listed(8, name)),
        (4, 5, whole(6)),
        (5, 6, whole(n)),
        (6, 6, whole(length)),
        (7, 6, whole(length)),
        (9, 6, whole(4 + (len(pages[0]) if dictionary else 0))),
    ]
    chunk = thrift((2, 6, whole(4)), (3, 12, thrift(*column, *[(11, 6, whole(4))] * dictionary)))
    group = thrift((1, 9, listed(12, chunk)), (2, 6, whole(length)), (3, 6, whole(n)))
    root = thrift((4, 8, unsigned(6) + b"schema"), (5, 5, whole(1)))
    leaf = thrift((1, 5, whole(5)), (3, 5, whole(0)), (4, 8, name))
    schema = (2, 9, listed(12, root, leaf))
    foot = thrift((1, 5, whole(1)), schema, (3, 6, whole(n)), (4, 9, listed(12, group)))
    path.write_bytes(b"PAR1" + b"".join(pages) + foot + struct.pack("<I", len(foot)) + b"PAR1")


LEVELS = (3, 5, whole(3)), (4, 5, whole(3))


@pytest.mark.parametrize("dictionary", [False, True])
def test_pages_of_parquet_that_unpack_to_gigabytes_are_refused(
    dictionary: bool, tmp_path: Path
) -> None:
    page_bomb(tmp_path / "small.parquet", 2**20, dictionary)
    page_bomb(tmp_path / "bomb.parquet", 3 * 2**29, dictionary)
    assert (tmp_path / "bomb.parquet").stat().st_size < 2**18
    said, memory = read_apart(tmp_path / "small.parquet", tmp_path / "bomb.parquet")
    assert said[0] == "read"  # so that it is the size which is refused
    assert "pages unpack to more than its samples take" in said[1]
    assert memory < MOST_MB


def test_only_numbers_of_parquet_are_read(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    n = 50_000
    words = pa.DictionaryArray.from_arrays(np.zeros(n, np.int32), ["x" * 100_000])
    table = {"note": words, "pressure_bar": np.sin(np.arange(n)), "list": [[0.0] * 10] * n}
    # 5 GB of text, written once; nothing says that it is to be kept so
    pq.write_table(pa.table(table), tmp_path / "a.parquet", store_schema=False)
    said, memory = read_apart(tmp_path / "a.parquet")
    assert said == ["read"]
    assert memory < MOST_MB


def test_times_in_words_are_still_read_from_parquet(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    times = [f"2026-01-31T12:00:{k / 10:04.1f}" for k in range(30)]
    table = {"time": times, "pressure_bar": malformed.PRESSURE, "branch": ["up", None] * 15}
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    (recording,) = mckibben.read(tmp_path / "a.parquet")
    assert recording.sample_time == pytest.approx(0.1)
    assert recording.meta["ignored_columns"] == ["branch"]


def test_closely_packed_samples_are_read_up_to_some_millions(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        rising = np.arange(200_000) // 1000
        file.create_dataset("a", data=rising, compression="gzip", shuffle=True)
    (recording,) = mckibben.read(tmp_path / "a.h5")
    assert np.array_equal(recording["a"], rising)


@pytest.mark.parametrize("shuffle", [False, True])
@pytest.mark.parametrize("fletcher32", [False, True])
@pytest.mark.parametrize("compression", [None, "gzip"])
@pytest.mark.parametrize("shape", [(50,), (50, 1)])
def test_packed_samples_are_read(
    shape: tuple[int, ...], compression: str | None, fletcher32: bool, shuffle: bool, tmp_path: Path
) -> None:
    import h5py

    samples = np.sin(np.arange(50)).reshape(shape)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        packing = {"compression": compression, "fletcher32": fletcher32, "shuffle": shuffle}
        file.create_dataset("a", data=samples, chunks=(7, 1)[: len(shape)], **packing)
    (recording,) = mckibben.read(tmp_path / "a.h5")
    assert np.array_equal(recording["a"], samples.reshape(-1))


def test_long_texts_about_a_recording_are_left_out(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["pressure"] = np.arange(20.0)
        file["pressure"].attrs["units"] = "k" * 60_000
        file.attrs["long"] = "x" * (limits.MOST_TEXT + 1)
        file.attrs["many"] = np.array(["x" * 1000] * 50, dtype=object)
    with pytest.raises(DataError, match="is unknown") as refused:
        mckibben.read(tmp_path / "a.h5")
    assert len(str(refused.value)) < 1500
    (recording,) = mckibben.read(tmp_path / "a.h5", units={"pressure": "bar"})
    assert not {"long", "many"} & set(recording.meta)


# MATLAB's own files, as SciPy reads them ------------------------------------------------


def test_vectors_of_matlab_files_are_those_that_scipy_reads(tmp_path: Path) -> None:
    from scipy.io import loadmat, savemat

    numbers = np.arange(12)
    kinds = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?")
    content: dict[str, Any] = {f"v{kind.strip('?')}": numbers.astype(kind) for kind in kinds}
    content |= {"matrix": np.eye(3), "complex": numbers * 1j, "words": ["up", "down"]}
    older = {"v": numbers.astype("f4"), "matrix": np.eye(3), "words": ["up", "down"], "w": numbers}
    savemat(tmp_path / "4.mat", older | {"complex": numbers * 1j}, format="4")
    (recording,) = mckibben.read(tmp_path / "4.mat")
    assert list(recording.channels) == ["v", "w"]
    assert all(np.array_equal(recording[name], numbers) for name in "vw")
    content |= {
        "cell": np.array([numbers, "a"], dtype=object),
        "deep": {"er": {"p": numbers * 0.5}},
    }
    for packed in (False, True):
        path = tmp_path / f"{packed}.mat"
        savemat(path, content, do_compression=packed)
        (recording,) = mckibben.read(path, units={"pressure": "bar"})
        known = loadmat(path, squeeze_me=True)
        for kind in kinds:
            name = f"v{kind.strip('?')}"
            assert np.array_equal(recording[name], known[name])
        assert np.array_equal(recording["pressure"], numbers * 0.5)
        assert len(recording.channels) == len(kinds) + 1


# What is no file, in every place --------------------------------------------------------


def sidecar_of(path: Path) -> None:
    run = path.with_name("run.csv")
    run.write_bytes(malformed.good())
    path.rename(delimited.sidecar(run))
    with pytest.warns(mckibben.DataWarning, match="it is ignored"):
        mckibben.read(run)


def protocol_of(path: Path) -> None:
    path.with_name("run.csv").write_bytes(malformed.good())
    path.rename(path.with_name("protocol.json"))
    with pytest.raises(DataError, match=r"ordinary|cannot be read|folder"):
        roles(path.parent)


def manifest_of(path: Path) -> None:
    folder = path.with_name("export")
    folder.mkdir()
    path.rename(folder / "manifest.sha256")
    (folder / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(DataError, match=r"mine\.txt in it was not written"):
        write_folder(folder, {"a.txt": b""}, overwrite=True)


def kept_of(path: Path) -> None:
    kept = Kept(path.parent)
    place = kept.file("part", ".json")
    assert place is not None
    path.rename(place)
    assert kept.get("part", Play) is None


def refused_by(reader: Callable[[Path], object], ending: str) -> Callable[[Path], None]:
    def check(path: Path) -> None:
        with pytest.raises(MckibbenError, match=r"ordinary|cannot be read|folder"):
            reader(path.rename(path.with_suffix(ending)))

    return check


PLACES: dict[str, Callable[[Path], None]] = {
    **{f"read{ending}": refused_by(mckibben.read, ending) for ending in (".csv", ".parquet")},
    **{f"read{ending}": refused_by(mckibben.read, ending) for ending in (".mat", ".h5", ".tdms")},
    "model": refused_by(mckibben.load, ".json"),
    "rig": refused_by(load_rig, ".toml"),
    "sidecar": sidecar_of,
    "protocol": protocol_of,
    "manifest": manifest_of,
    "kept": kept_of,
}


def circle(path: Path) -> None:
    path.symlink_to(path.with_name("round"))
    path.with_name("round").symlink_to(path)


KINDS: dict[str, Callable[[Path], object]] = {
    "pipe": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "circle": circle,
    "folder": Path.mkdir,
}


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", PLACES)
def test_what_is_no_ordinary_file_is_refused_wherever_one_is_read(
    place: str, kind: str, tmp_path: Path
) -> None:
    KINDS[kind](tmp_path / "x")
    PLACES[place](tmp_path / "x")


# Descriptions ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", ["[" * 100_000, "9" * 5000, '{"runs": ' + "9" * 5000 + "}", "null", '{"runs": [null]}']
)
def test_hostile_descriptions_are_refused(text: str, tmp_path: Path) -> None:
    run = tmp_path / "run.csv"
    run.write_bytes(malformed.good())
    (tmp_path / "protocol.json").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"protocol\.json is not readable"):
        roles(tmp_path)
    delimited.sidecar(run).write_text(text, encoding="utf-8")
    with pytest.warns(mckibben.DataWarning, match="it is ignored") as warned:
        mckibben.read(run)
    assert all(len(str(one.message)) < 1000 for one in warned)


@pytest.mark.parametrize(
    "change",
    [
        {"units": {"pressure": "bar"}},
        {"units": {"pressure": "bar", "displacement": "mm", "force": "N"}},
        {"units": {"displacement": "mm", "pressure": "bar"}},
        {"sample_time": None},
        {"sample_time": 1e-320},
        {"sample_time": 0.0},
    ],
)
def test_descriptions_of_other_columns_are_ignored(change: dict[str, Any], tmp_path: Path) -> None:
    run, n = tmp_path / "run.csv", np.arange(20, dtype=np.float64)
    units = {"pressure": "bar", "displacement": "mm"}
    mckibben.write(mckibben.Recording({"pressure": n, "displacement": n}, 0.1, units=units), run)
    about = json.loads(delimited.sidecar(run).read_text(encoding="utf-8"))
    delimited.sidecar(run).write_text(json.dumps(about | change), encoding="utf-8")
    with pytest.warns(mckibben.DataWarning, match="it is ignored"):
        (recording,) = mckibben.read(run, units=units | {"time": "s"})
    assert recording.sample_time == pytest.approx(0.1)
    assert np.array_equal(recording["pressure"], n)


@pytest.mark.parametrize("before", ["sep=;\n", "\ufeffsep=;\r\n", "\ufeff\ufeff"])
def test_what_programs_put_before_a_table_is_passed_over(before: str, tmp_path: Path) -> None:
    rows = [f"{k};{k / 8:.3f}".replace(".", ",") for k in range(20)]
    text = before + "\n".join(["time_s;pressure_bar", *rows])
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    (recording,) = mckibben.read(tmp_path / "a.csv")
    assert list(recording.channels) == ["pressure"]
    assert np.array_equal(recording["pressure"], np.arange(20) / 8)


def test_long_descriptions_are_not_read(tmp_path: Path) -> None:
    run = tmp_path / "run.csv"
    mckibben.write(mckibben.Recording({"a": np.arange(20, dtype=float)}, 0.1), run)
    about = json.loads(delimited.sidecar(run).read_text(encoding="utf-8"))
    about["meta"] = {"long": "x" * 2**22}
    delimited.sidecar(run).write_text(json.dumps(about), encoding="utf-8")
    with pytest.warns(mckibben.DataWarning, match="it is ignored"):
        (recording,) = mckibben.read(run, units={"time": "s"})
    assert "long" not in recording.meta


def test_numbers_without_end_in_a_rig_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        f'format = "mckibben-rig"\nformat_version = 1\nsetup = 0x{"f" * 9000}\n', encoding="utf-8"
    )
    with pytest.raises(DataError, match="setup is"):
        load_rig(tmp_path / "a.toml")


def test_the_digest_is_of_the_bytes_that_were_read(tmp_path: Path, monkeypatch: Any) -> None:
    """A file that is replaced while it is read tells what was read, not what came after."""
    import hashlib

    from mckibben.files import formats

    path, original = tmp_path / "a.csv", malformed.good()
    path.write_bytes(original)
    read = formats.read

    def replace_after(file: io.BufferedReader, of: Path) -> Any:
        found = read(file, of)
        (tmp_path / "new").write_bytes(b"other")
        (tmp_path / "new").replace(path)
        return found

    monkeypatch.setattr(formats, "read", replace_after)
    (recording,) = mckibben.read(path)
    assert recording.meta["sha256"] == hashlib.sha256(original).hexdigest()

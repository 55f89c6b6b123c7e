"""Data sets of HDF5 in chunks: the samples are those that HDF5's own filters give."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import mckibben
from mckibben import DataError

WAYS = [
    {"compression": compression, "shuffle": shuffle, "fletcher32": fletcher}
    for compression in (None, "gzip")
    for shuffle in (False, True)
    for fletcher in (False, True)
]


def same_as_hdf5(path: Path) -> None:
    with h5py.File(path) as file:
        expected = file["a"][()].reshape(-1).astype(np.float64)
    (recording,) = mckibben.read(path)
    np.testing.assert_array_equal(recording["a"], expected)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", "<f2", ">i2", "u1", "<i8", "?"])
@pytest.mark.parametrize(
    ("shape", "chunks"), [((100,), (7,)), ((100,), (100,)), ((100, 1), (30, 3)), ((1, 100), (2, 9))]
)
def test_samples_are_those_of_hdf5(
    shape: tuple[int, ...], chunks: tuple[int, ...], kind: str, way: dict[str, Any], tmp_path: Path
) -> None:
    samples = (10 + 90 * np.sin(np.arange(100.0) / 9)).clip(0, 100).astype(kind).reshape(shape)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        room = tuple(max(n, step) for n, step in zip(shape, chunks, strict=True))
        data = file.create_dataset(
            "a", room, kind, chunks=chunks, maxshape=(None,) * len(shape), **way
        )
        data[tuple(slice(n) for n in shape)] = samples
        data.resize(shape)
    same_as_hdf5(tmp_path / "a.h5")


@pytest.mark.parametrize("way", WAYS)
def test_chunks_that_were_never_written_hold_what_fills_them(
    way: dict[str, Any], tmp_path: Path
) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", (100,), "f8", chunks=(7,), fillvalue=2.5, **way)
        data[20:60] = np.arange(40.0)
    same_as_hdf5(tmp_path / "a.h5")


@pytest.mark.parametrize("way", WAYS)
def test_numbers_of_a_kind_that_numpy_has_not_are_converted(
    way: dict[str, Any], tmp_path: Path
) -> None:
    kind = h5py.h5t.STD_I32LE.copy()
    kind.set_precision(24)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        about = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        about.set_chunk((7,))
        if way["shuffle"]:
            about.set_shuffle()
        if way["compression"]:
            about.set_deflate(4)
        if way["fletcher32"]:
            about.set_fletcher32()
        space = h5py.h5s.create_simple((100,))
        data = h5py.Dataset(h5py.h5d.create(file.id, b"a", kind, space, about))
        data[...] = np.arange(100) * 20 - 50
    same_as_hdf5(tmp_path / "a.h5")


@pytest.mark.parametrize("order", [(1, 3), (3, 1), (3, 2, 1), (1, 2, 3)])
@pytest.mark.parametrize("size", [21, 900, 700_000])
def test_checksums_are_looked_at_wherever_they_stand(
    order: tuple[int, ...], size: int, tmp_path: Path
) -> None:
    """With sizes odd and even, and larger than what HDF5 sums up at once."""
    samples = np.random.default_rng(size).integers(0, 255, size, np.uint8)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        about = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        about.set_chunk((size,))
        for number in order:
            {1: lambda: about.set_deflate(1), 2: about.set_shuffle, 3: about.set_fletcher32}[
                number
            ]()
        space = h5py.h5s.create_simple((size,))
        data = h5py.Dataset(h5py.h5d.create(file.id, b"a", h5py.h5t.STD_U8LE, space, about))
        data[...] = samples
    same_as_hdf5(tmp_path / "a.h5")


def test_a_wrong_checksum_is_refused(tmp_path: Path) -> None:
    packed = zlib.compress(np.arange(20.0).tobytes())
    for checksum in (b"\0\0\0\0", b"\1\2\3\4"):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            data = file.create_dataset(
                "a", (20,), "f8", chunks=(20,), compression="gzip", fletcher32=True
            )
            data.id.write_direct_chunk((0,), packed + checksum)
        with pytest.raises(DataError, match="less closely than it says"):
            mckibben.read(tmp_path / "a.h5")


@pytest.mark.parametrize("width", [0, 3, 2**31])
def test_a_width_of_shuffled_samples_that_is_not_theirs_is_refused(
    width: int, tmp_path: Path
) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset(
            "a", data=np.arange(20.0), chunks=(20,), compression="gzip", shuffle=True
        )
        about = data.id.get_create_plist()
    content = (tmp_path / "a.h5").read_bytes()
    said = struct.pack("<HHHH", 2, 8, 1, 1) + b"shuffle\0"
    assert about.get_filter(0)[0] == 2
    assert said in content
    place = content.index(said) + len(said)
    assert content[place : place + 4] == struct.pack("<I", 8)
    (tmp_path / "a.h5").write_bytes(
        content[:place] + struct.pack("<I", width) + content[place + 4 :]
    )
    with pytest.raises(DataError, match="only deflate, shuffle and fletcher32"):
        mckibben.read(tmp_path / "a.h5")

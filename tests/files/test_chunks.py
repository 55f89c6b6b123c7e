"""Data sets of HDF5 in chunks: the samples are those that HDF5's own filters give."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import mckibben

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
    ("shape", "chunks"), [((100,), (7,)), ((100, 1), (30, 3)), ((1, 100), (2, 9))]
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


def test_numbers_of_a_kind_that_numpy_has_not_are_converted(tmp_path: Path) -> None:
    kind = h5py.h5t.STD_I32LE.copy()
    kind.set_precision(24)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        about = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        about.set_chunk((7,))
        about.set_shuffle()
        about.set_deflate(4)
        space = h5py.h5s.create_simple((100,))
        data = h5py.Dataset(h5py.h5d.create(file.id, b"a", kind, space, about))
        data[...] = np.arange(100) * 20 - 50
    same_as_hdf5(tmp_path / "a.h5")


def test_closely_packed_samples_are_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        rising = np.arange(200_000) // 1000
        file.create_dataset("a", data=rising, compression="gzip", shuffle=True)
    same_as_hdf5(tmp_path / "a.h5")

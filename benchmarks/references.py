"""What the kernels are measured beside: per-sample NumPy, and plain C compiled on the spot."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben import GPI, PI

Array = NDArray[np.float64]


def numpy_pi(block: PI, u: Array) -> Array:
    """Return a PI model's output, one NumPy expression a sample."""
    r, w = np.array(block.thresholds), np.array(block.weights)
    s = u[0] - r
    y = np.empty_like(u)
    for t in range(u.size):
        s = np.minimum(np.maximum(s, u[t] - r), u[t] + r)
        y[t] = block.offset + w @ s
    return y


def numpy_gpi(block: GPI, u: Array) -> Array:
    """Return a GPI model's output, one NumPy expression a sample."""
    r, w = np.array(block.thresholds), np.array(block.weights)
    rising, falling = block.rising(u), block.falling(u)
    s = rising[0] - r
    y = np.empty_like(u)
    for t in range(u.size):
        if t and u[t] > u[t - 1]:
            s = np.maximum(s, rising[t] - r)
        elif t and u[t] < u[t - 1]:
            s = np.minimum(s, falling[t] + r)
        y[t] = w @ s
    return y


class Compiled:
    """The loops of ``play.c``, compiled by gcc into a folder.

    Parameters
    ----------
    folder : Path
        Where the library is put.
    """

    def __init__(self, folder: Path) -> None:
        library = folder / "play.so"
        source = Path(__file__).with_name("play.c")
        command = ["gcc", "-O3", "-march=native", "-shared", "-fPIC", "-std=c99"]
        subprocess.run([*command, "-o", library, source, "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))

    @staticmethod
    def available() -> bool:
        """Tell whether gcc is there."""
        return shutil.which("gcc") is not None

    def pi(self, block: PI, u: Array) -> Array:
        """Return a PI model's output."""
        r, w = np.array(block.thresholds), np.array(block.weights)
        s, y = u[0] - r, np.empty_like(u)
        self._call("pi", u.size, r.size, r, w, s, u, y)
        return y + block.offset

    def gpi(self, block: GPI, u: Array) -> Array:
        """Return the output of a GPI model with tanh envelopes."""
        r, w = np.array(block.thresholds), np.array(block.weights)
        s, y = block.rising(u[:1]) - r, np.empty_like(u)
        envelopes = np.concatenate([block.rising.pack(), block.falling.pack()])
        self._call("gpi", u.size, r.size, r, w, s, envelopes, u, y)
        return y

    def _call(self, name: str, n: int, n_op: int, *arrays: Array) -> None:
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]
        getattr(self._library, name)(ctypes.c_size_t(n), ctypes.c_size_t(n_op), *pointers)

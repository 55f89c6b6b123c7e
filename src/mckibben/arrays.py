"""The array that the package computes with, and the narrowest range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Double-precision numbers, of any shape."""

NARROWEST = 1e-30
"""Least range of a channel that can be computed with, in its unit: products of less would vanish."""

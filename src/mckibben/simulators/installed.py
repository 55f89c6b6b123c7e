"""MuJoCo, or how to get it."""

from __future__ import annotations

from mckibben.errors import DataError

try:
    import mujoco as mujoco
except ImportError as missing:
    raise DataError(
        "muscles in MuJoCo need the package mujoco", remedy="pip install 'mckibben[mujoco]'"
    ) from missing

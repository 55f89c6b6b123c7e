"""MuJoCo, or how to get it."""

from __future__ import annotations

from mckibben.system.extras import demand

demand("mujoco", "mujoco", "muscles in MuJoCo")

import mujoco as mujoco  # noqa: E402

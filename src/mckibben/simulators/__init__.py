"""Fitted muscles in other people's simulators: `mckibben.simulators.mujoco` (an optional extra)."""

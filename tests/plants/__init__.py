"""Virtual plants from textbook physics, by name: ``PLANTS[name](seed)`` draws all runs of one.

Models may be tuned on plants of ``DEVELOP``. Those of ``SEALED`` are to judge models that are
finished, and nothing else.
"""

from __future__ import annotations

from functools import partial

from tests.plants.plant import Bench, Fact, Motion, Plant, drawn

__all__ = ["DEVELOP", "PLANTS", "SEALED", "Bench", "Fact", "Motion", "Plant"]

DEVELOP = ("lugre_muscle", "antagonistic_joint", "continuum_section", "soft_finger")
SEALED = (
    "load_rig",
    "three_muscle_arm",
    "lifter",
    "pushing_rig",
    "valve_muscle",
    "isometric_bench",
    "swinging_arm",
    "piezo_stage",
)
PLANTS = {name: partial(drawn, name) for name in DEVELOP + SEALED}

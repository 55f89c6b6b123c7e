"""Virtual plants from textbook physics, by name: ``PLANTS[name](seed)`` draws all runs of one.

Models may be tuned on plants of ``DEVELOP``. Those of ``SEALED`` are to judge models that are
finished, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable

from tests.plants import antagonistic_joint, load_rig, lugre_muscle, three_muscle_arm
from tests.plants.plant import Bench, Fact, Plant, Respond

__all__ = ["DEVELOP", "PLANTS", "SEALED", "Bench", "Fact", "Plant", "Respond"]

PLANTS: dict[str, Callable[[int], Plant]] = {
    "lugre_muscle": lugre_muscle.plant,
    "load_rig": load_rig.plant,
    "antagonistic_joint": antagonistic_joint.plant,
    "three_muscle_arm": three_muscle_arm.plant,
}
DEVELOP = ("lugre_muscle", "antagonistic_joint")
SEALED = ("load_rig", "three_muscle_arm")

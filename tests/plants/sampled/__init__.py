"""Plants drawn at random with their truth, written without knowledge of any model of the package.

Their physics is in `tests.plants.sampled.physics`. In all of them:

- x or displacement is contraction, positive shorter; length is rest length - x. Angle grows as muscle 1
  contracts.
- Force is the pull at the muscle's end, which is the payload's weight; where there is a wall on the way,
  or inertia, it is the weight only, as from scales. Torque is the payload's on the joint.
- Pressure is that inside or the command, as ``pressure_recorded`` says.
- Every run begins with a muscle that was filled from zero pressure in 3.2 s and then waited for 4.8 s,
  which is not recorded.
"""

from __future__ import annotations

from tests.plants.sampled.draws import Plant, Truth
from tests.plants.sampled.families import (
    KINDS,
    clean,
    drifting,
    isometric,
    known_parameters,
    load_rig,
    mixed,
    torque_joint,
    with_one,
)

__all__ = [
    "KINDS",
    "Plant",
    "Truth",
    "clean",
    "drifting",
    "isometric",
    "known_parameters",
    "load_rig",
    "mixed",
    "torque_joint",
    "with_one",
]

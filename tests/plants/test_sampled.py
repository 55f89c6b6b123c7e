"""Plants drawn at random are repeatable, finite, and come with their truth."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from tests.plants import sampled
from tests.plants.sampled import Plant

FAMILIES: dict[str, tuple[Callable[[int], Plant], tuple[str, ...]]] = {
    "clean": (sampled.clean, ("friction", "travel_mm")),
    "with_one": (partial(sampled.with_one, "wall"), ("wall_mm", "share_of_training_in_contact")),
    "known_parameters": (sampled.known_parameters, ("area_mm2", "ratios_to_spring")),
    "torque_joint": (sampled.torque_joint, ("pulley_radius_mm", "loads_of_training_N_m")),
    "isometric": (partial(sampled.isometric, length_noise=0.01), ("lengths_mm", "noise_std")),
    "mixed": (sampled.mixed, ("held_lengths_mm", "spring_of_test_N_per_mm")),
    "drifting": (sampled.drifting, ("drift", "rate")),
    "load_rig": (sampled.load_rig, ("loads_of_training_N", "inertia")),
}


@pytest.mark.parametrize("family", FAMILIES)
def test_a_plant_is_drawn_again_and_finite_and_has_its_truth(family: str) -> None:
    draw, told = FAMILIES[family]
    plant, again = draw(0), draw(0)
    assert plant == again
    assert set(told) <= set(plant.truth)
    assert all(run.name.startswith("train") for run in plant.train)
    tests = [run for runs in plant.tests.values() for run in runs]
    for run in (*plant.train, *tests):
        assert np.isfinite(run.matrix(list(run.channels))).all()


@pytest.mark.parametrize("kind", sampled.KINDS)
def test_a_phenomenon_is_seen_in_training(kind: str) -> None:
    truth = sampled.with_one(kind, 0).truth
    assert truth["phenomenon"] == kind
    for name, share in truth.items():
        if name.startswith("share_of_training"):
            assert 0.05 < share < 0.6

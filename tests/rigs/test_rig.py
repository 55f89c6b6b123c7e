"""A rig as its users see it: running, stepping, saturating, and what physics should show."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from mckibben import DataError, DataWarning
from mckibben.recording import Recording, base_name
from mckibben.rigs import load_rig, rig_names, save_rig
from mckibben.signals import irregular_triangle, sine
from tests.refusals import refused


@pytest.mark.parametrize("name", rig_names())
def test_saved_stepped_and_finely_integrated_rigs_agree(name: str, tmp_path: Path) -> None:
    rig = load_rig(name)
    save_rig(rig, tmp_path / "rig.toml")
    assert load_rig(tmp_path / "rig.toml") == rig
    time = np.arange(0.0, 30.0, 0.01)
    ranges = {name: rig.limits(name) for name in rig.inputs}
    waves = {
        name: irregular_triangle(
            time, 9, 0.1 * x.low + 0.9 * x.high, 0.95 * x.low + 0.05 * x.high, seed=seed
        )
        for seed, (name, x) in enumerate(ranges.items())
    }
    first = Recording({name: wave[:50] for name, wave in waves.items()}, rig.sample_time)
    stepped = [rig.reset(3), *(rig.step(row) for row in first.matrix(rig.inputs)[:-1])]
    assert np.array_equal(rig.run(first, 3, held=True).matrix(rig.outputs), stepped)
    given = Recording(waves, 0.01)
    coarse = rig.run(given, ideal=True)
    fine = rig.changed({"integration_step": rig.integration_step / 2}).run(given, ideal=True)
    for channel in rig.outputs:
        sensor = rig.sensor[base_name(channel)]
        change = np.sqrt(np.mean((coarse[channel] - fine[channel]) ** 2))
        assert change <= max(sensor.noise, sensor.resolution)


def test_runs_do_not_disturb_one_another() -> None:
    rig = load_rig("mas20-hanging")
    time = np.arange(0, 3.0, rig.sample_time)
    given = Recording({"pressure": sine(time, 1.5, 6.0)}, rig.sample_time)
    alone = rig.run(given, seed=1)
    rig.reset(seed=5)
    rig.step([4.0])
    with ThreadPoolExecutor(4) as pool:
        others = list(pool.map(lambda seed: rig.run(given, seed=seed), [1, 2, 1, 3]))
    assert others[0] == others[2] == alone
    assert others[1] != alone
    ideal = rig.run(given, ideal=True)
    assert others[1]["displacement"] == pytest.approx(ideal["displacement"], abs=0.15)
    assert rig.run(given, seed=7, ideal=True) == ideal


def test_sensors_have_noise_resolution_and_offset() -> None:
    rig = load_rig("mas20-hanging").changed({"sensor.displacement.offset": 2.0})
    given = Recording({"pressure": np.full(2000, 3.0)}, 0.01)
    run, ideal = rig.run(given), rig.run(given, ideal=True)
    off = run["displacement"] - ideal["displacement"]
    assert off.mean() == pytest.approx(2.0, abs=0.005)
    assert off.std() == pytest.approx(0.02, rel=0.15)
    steps = run["displacement"] / 0.01
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    assert rig.run(given.select(["pressure"]), seed=0) == run


def test_a_command_beyond_the_range_saturates_and_the_recording_says_so() -> None:
    rig = load_rig("mas20-hanging")
    wave = np.linspace(-1.0, 9.0, 1001)
    with pytest.warns(DataWarning, match="pressure"):
        run = rig.run(Recording({"pressure": wave}, 0.01))
    beyond = int(np.count_nonzero((wave < 0) | (wave > 6)))
    assert run.meta["saturated"] == {"pressure": beyond}
    assert run["pressure"].max() < 6.1
    assert "saturated" not in rig.run(Recording({"pressure": wave.clip(0, 6)}, 0.01)).meta
    rig.reset()
    rig.step([99.0])
    rig.step([3.0])
    assert rig.saturated == {"pressure": 1}


def test_the_supply_limits_the_pressure() -> None:
    rig = load_rig("mas20-hanging").changed({"air.supply": 3.0})
    run = rig.run(Recording({"pressure": np.full(1000, 6.0)}, 0.01), ideal=True)
    assert run["pressure"][-1] == pytest.approx(3.0, abs=0.01)
    assert run["pressure"].max() < 3.3  # the swinging mass presses some air back


def test_wrong_inputs_and_actions_are_refused() -> None:
    two = np.array([1.0, 2.0])
    for given in (
        Recording({"pressure": two}, None),
        Recording({"force": two}, 0.01),
        Recording({"displacement": two}, 0.01),
    ):
        with pytest.raises(DataError):
            load_rig("mas20-hanging").run(given)
    rig = load_rig("rail")
    with pytest.raises(DataError):  # before it is reset
        rig.step([1.0, 0.0])
    rig.reset()
    with refused(DataError, channel=None, names="force"):
        rig.step([1.0])
    with refused(DataError, channel="force"):
        rig.step([1.0, np.nan])
    with refused(DataError, channel="pressure"):
        rig.step({"pressure": 1.0})
    with refused(DataError, parameter="seed"):
        rig.reset(seed=-1)
    assert rig.step({"voltage": 3.0}).shape == (3,)

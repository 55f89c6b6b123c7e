"""An adaptive compensator in firmware at 200 Hz, compared with a fixed one on a drifting robot.

    python examples/robot_firmware.py docs/pictures/robot_firmware.png --fast

The reference goes over a serial port to an adaptive inverse on an emulated Cortex-M4F, its pressure
to a virtual rig in another process, and the measurement back to the firmware. Halfway, stiffness
decreases and friction increases by 20 %. The fixed inverse then follows the same reference on the
same rig, in Python.

QEMU and an Arm compiler are required. --here runs the same C code as a local process, and --port
uses a board with such an export. Host, firmware and rig run in lock-step, so the results do not
depend on timing, and --fast ignores deadlines. --model replaces the inverse that is fitted here by
another adaptive inverse (``mckibben invert --adaptive``); --save stores the learned parameters.
"""

from __future__ import annotations

import argparse
import multiprocessing
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben.blocks.adaptive import Adaptive, adaptive
from mckibben.exporting import Serving, state_of
from mckibben.exporting.c.emulation import serial_device
from mckibben.link import Link
from mckibben.rigs.drifting import Drifting
from mckibben.signals import random_wave
from mckibben.stream import FixedRate

RIG, PERIOD = "mas20-hanging", 0.005
CHANGES = {"stiffness": 0.8, "friction": 1.2}
"""Parameters that drift, and their factors."""

APPROACH = 10.0
"""Duration of the transition from rest to the wave [s]."""

WITHIN, PRESSURES = (-20.0, 60.0), (0.0, 6.0)
"""Ranges of the firmware's input [mm] and output [bar]."""


def drifting(duration: float) -> Drifting:
    """Return the robot, which begins to drift halfway."""
    rig = mckibben.load_rig(RIG).changed({"sample_time": PERIOD})
    return Drifting(rig, CHANGES, start=0.5 * duration)


def robot(pipe: Connection, duration: float) -> None:
    """Run the robot: receive pressures and send displacements until the connection ends."""
    rig = drifting(duration)
    place = rig.outputs.index("displacement")
    pipe.send(float(rig.reset(0)[place]))
    while (pressure := pipe.recv()) is not None:
        pipe.send(float(rig.step({"pressure": pressure})[place]))


def learning() -> Adaptive:
    """Return an adaptive inverse fitted to two minutes of the rig."""
    time = np.arange(2400) * 0.05
    pressure = random_wave(time, 0.4, high=5.0, seed=1)
    recording = mckibben.load_rig(RIG).run(mckibben.Recording({"pressure": pressure}, 0.05))
    block = adaptive(mckibben.GPIEstimator().fit(recording).model_, time=60.0)
    assert isinstance(block, Adaptive)
    return block


def wanted(n: int) -> np.ndarray:
    """Return a smooth reference [mm] from rest, with loops of all sizes."""
    time = np.arange(n) * PERIOD
    wave = random_wave(time, 0.4, high=22.0, low=4.0, min_frequency=0.05, seed=3)
    share = np.clip(time / APPROACH, 0.0, 1.0)
    return np.asarray(share**2 * (3 - 2 * share) * wave)


def follow(
    turns: Iterable[object],
    reference: np.ndarray,
    measured: float,
    compensate: Callable[[float, float], float],
    moved: Callable[[float], float],
) -> np.ndarray:
    """Follow a reference sample by sample, and return the measurements [mm]."""
    found = np.empty(len(reference))
    for k, _ in zip(range(len(reference)), turns, strict=False):
        seen = min(max(measured, WITHIN[0]), WITHIN[1])  # sensors may fail
        found[k] = measured = moved(compensate(float(reference[k]), seen))
    return found


def in_firmware(
    link: Link, reference: np.ndarray, duration: float, *, fast: bool
) -> tuple[np.ndarray, str]:
    """Return the measurements [mm] and the statistics of deadlines."""
    ours, theirs = multiprocessing.Pipe()
    context = multiprocessing.get_context("spawn")
    process = context.Process(target=robot, args=(theirs, duration), daemon=True)
    process.start()
    theirs.close()

    def moved(pressure: float) -> float:
        ours.send(pressure)
        return float(ours.recv())

    def compensate(*inputs: float) -> float:
        return float(link.step(inputs).outputs[0])

    first, rate = float(ours.recv()), FixedRate(PERIOD)
    turns = range(len(reference)) if fast else rate
    found = follow(turns, reference, first, compensate, moved)
    ours.send(None)
    process.join()
    return found, "as fast as it goes" if fast else str(rate.deadlines)


def fixed(block: Adaptive, reference: np.ndarray, duration: float) -> np.ndarray:
    """Return the measurements [mm] with the fixed inverse."""
    rig, stream = drifting(duration), block.fixed.stream(PERIOD)
    place = rig.outputs.index("displacement")

    def compensate(asked: float, _: float) -> float:
        return float(np.clip(stream.step([asked])[0], *PRESSURES))

    def moved(pressure: float) -> float:
        return float(rig.step({"pressure": pressure})[place])

    return follow(reference, reference, float(rig.reset(0)[place]), compensate, moved)


def rms(errors: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def spans(n: int) -> tuple[slice, slice]:
    """Return the last fifth before the drift, and the last fifth."""
    return slice(3 * n // 10, n // 2), slice(4 * n // 5, n)


def draw(path: Path, reference: np.ndarray, runs: dict[str, np.ndarray]) -> None:
    """Draw the errors over time, and the motion before and after the drift."""
    n, window = len(reference), max(len(reference) // 120, 1)
    time = np.arange(n) * PERIOD
    half = 0.5 * n * PERIOD
    figure = Figure(figsize=(9, 6.4), layout="constrained")
    axes = figure.subplot_mosaic([["errors", "errors"], ["before", "after"]])
    colours = {"fixed": "tab:red", "adaptive": "tab:blue"}
    top = axes["errors"]
    top.axvline(half, color="0.6", ls="--", label="drift")
    for name, measured in runs.items():
        error = (measured - reference)[: n - n % window].reshape(-1, window)
        size = np.sqrt(np.mean(error**2, axis=1))
        middle = time[: n - n % window].reshape(-1, window).mean(axis=1)
        by = " and ".join(f"{rms((measured - reference)[span]):.2f}" for span in spans(n))
        top.plot(middle, size, color=colours[name], label=f"{name}: {by} mm before and after")
    changes = ", ".join(f"{group} {factor - 1:+.0%}" for group, factor in CHANGES.items())
    top.set(title=f"robot: {changes} from {half:g} s on".replace("%", " %"))
    top.set(xlabel="time [s]", ylabel=f"error, RMS of {window * PERIOD:g} s [mm]")
    top.set_ylim(bottom=0.0)
    top.legend(loc="upper left")
    shown = min(round(20.0 / PERIOD), n // 5)
    for name, end in (("before", n // 2), ("after", n)):
        axis, part = axes[name], slice(end - shown, end)
        axis.plot(time[part], reference[part], color="0.2", lw=2.5, alpha=0.5, label="reference")
        for run, measured in runs.items():
            axis.plot(time[part], measured[part], color=colours[run], lw=1.0, label=run)
        axis.set(title=f"{name} the drift", xlabel="time [s]", ylabel="displacement [mm]")
    axes["before"].legend()
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("picture", type=Path, nargs="?", help="where to draw it")
    parser.add_argument("--duration", type=float, default=600.0, help="[s]")
    parser.add_argument("--fast", action="store_true", help="wait for no deadline")
    parser.add_argument("--model", type=Path, help="adaptive inverse (JSON)")
    parser.add_argument("--save", type=Path, help="where to keep what was learnt (JSON)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--port", help="serial port of a board, instead of the emulated one")
    where.add_argument("--here", action="store_true", help="as a process, without emulation")
    chosen = parser.parse_args()
    block = mckibben.load(chosen.model) if chosen.model else learning()
    if not isinstance(block, Adaptive):
        parser.error(f"{chosen.model} is no adaptive inverse")
    reference = wanted(round(chosen.duration / PERIOD))
    asked, measured = (channel.name for channel in block.inputs)
    limits = {asked: WITHIN, measured: WITHIN, block.outputs[0].name: PRESSURES}
    serving = Serving(limits, watchdog=0.5)
    device: AbstractContextManager[str]
    if chosen.port:
        device = nullcontext(chosen.port)
    else:
        emulated = not chosen.here
        device = serial_device(block, sample_time=PERIOD, serving=serving, emulated=emulated)
    with device as port, Link(port, lock_step=True, patience=10.0) as link:
        learnt, kept = in_firmware(link, reference, chosen.duration, fast=chosen.fast)
        state = state_of(block, link.memory(), PERIOD)
        steps, statistics = link.state().steps, link.statistics
    print(
        f"The device took {steps} steps, {kept}; {statistics.repeated} frames were sent again, "
        f"{statistics.dropped} dropped, and it was resumed {statistics.resumed} times"
    )
    runs = {"fixed": fixed(block, reference, chosen.duration), "adaptive": learnt}
    for name, found in runs.items():
        before, after = (rms((found - reference)[span]) for span in spans(len(reference)))
        print(f"{name}: followed within {before:.4f} mm RMS before the drift, {after:.4f} after it")
    model = block.present(state)
    print(model)
    if chosen.save:
        block.resumed(state).save(chosen.save)
    if chosen.picture:
        draw(chosen.picture, reference, runs)


if __name__ == "__main__":
    main()

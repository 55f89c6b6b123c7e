"""A controller in firmware, led over a serial line, and a virtual rig as the robot in another process.

    .venv/bin/python examples/robot_firmware.py --duration 20

The controller is exported to C with its limits and its watchdog, and runs on an emulated Cortex-M4F
(QEMU, and an Arm compiler, must be installed; --here runs the same C as a process of this machine, and
--port leads a board that holds such an export). 200 times a second the host gives it the reference and
what the rig measured, and the rig the pressure that it answers. --model takes any saved controller or
inverse with a reference, or a reference and what was measured, as inputs.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
from contextlib import AbstractContextManager, nullcontext
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

import mckibben
from mckibben.blocks.feedback.feedforward_feedback import FeedforwardFeedback
from mckibben.control import tune_pid
from mckibben.export import Serving
from mckibben.link import ByteStream, Link
from mckibben.link.trying import emulated, hosted
from mckibben.signals import decaying_triangle
from mckibben.stream import FixedRate

RIG = "mas20-hanging"
WITHIN = (-20.0, 60.0)
"""References and measurements that the firmware takes [mm]."""


def robot(pipe: Connection, period: float) -> None:
    """Be the robot: take a pressure, give the displacement, until there is none."""
    rig = mckibben.load_rig(RIG).changed({"sample_time": period})
    place = rig.outputs.index("displacement")
    pipe.send(float(rig.reset(0)[place]))
    while (pressure := pipe.recv()) is not None:
        pipe.send(float(rig.step({"pressure": pressure})[place]))


def controller(period: float) -> mckibben.Block:
    """Return a compensator fitted to the rig, with feedback."""
    rig = mckibben.load_rig(RIG)
    time = np.arange(3000) * 0.05
    pressure = decaying_triangle(time, low=0.0, high=5.0, period=20.0)
    recording = rig.run(mckibben.Recording({"pressure": pressure}, 0.05))
    inverse = mckibben.GPIEstimator().fit(recording).model_.inverse()
    return FeedforwardFeedback.of(inverse, tune_pid(rig, sample_time=period))


def serving(block: mckibben.Block) -> Serving:
    """Return what the firmware accepts: motions of this rig, and pressures that it stands."""
    limits = mckibben.load_rig(RIG).limits("pressure")
    pressures = dict.fromkeys((c.name for c in block.outputs), (limits.low, limits.high))
    return Serving(
        {**dict.fromkeys((c.name for c in block.inputs), WITHIN), **pressures}, watchdog=0.5
    )


def follow(link: Link, pipe: Connection, period: float, duration: float) -> tuple[float, str]:
    """Follow a wave, and return the root-mean-square error [mm] and how well time was kept."""
    rate, errors, measured = FixedRate(period, duration), [], pipe.recv()
    n_inputs = len(link.device.inputs)
    for k in rate:
        reference = 12.0 - 6.0 * math.cos(2 * math.pi * k * period / 5.0)
        low, high = WITHIN
        seen = min(max(measured, low), high)  # a sensor may say anything
        pipe.send(float(link.step([reference, seen][:n_inputs]).outputs[0]))
        measured = pipe.recv()
        errors.append(reference - measured)
    settled = np.array(errors)[len(errors) // 5 :]
    return float(np.sqrt(np.mean(settled**2))), str(rate.deadlines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--period", type=float, default=0.005, help="of control and rig [s]")
    parser.add_argument("--duration", type=float, default=20.0, help="[s]")
    parser.add_argument("--model", type=Path, help="controller or inverse (JSON)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--port", help="serial port of a board, instead of the emulated one")
    where.add_argument("--here", action="store_true", help="as a process, without emulation")
    chosen = parser.parse_args()
    block = mckibben.load(chosen.model) if chosen.model else controller(chosen.period)
    ours, theirs = multiprocessing.Pipe()
    context = multiprocessing.get_context("spawn")
    process = context.Process(target=robot, args=(theirs, chosen.period), daemon=True)
    device: AbstractContextManager[ByteStream | str]
    if chosen.port:
        device = nullcontext(chosen.port)
    elif chosen.here:
        device = hosted(block, sample_time=chosen.period, single=True, serving=serving(block))
    else:
        device = emulated(block, sample_time=chosen.period, serving=serving(block))
    with device as line, Link(line, lock_step=True) as link:
        process.start()
        error, kept = follow(link, ours, chosen.period, chosen.duration)
        ours.send(None)
        process.join()
        counts, statistics = link.counts(), link.statistics
    print(f"Followed within {error:.2f} mm RMS: {kept}")
    print(
        f"The device took {counts.steps} steps; {statistics.repeated} frames were sent again, "
        f"{statistics.dropped} dropped, and it was led again {statistics.reopened} times"
    )


if __name__ == "__main__":
    main()

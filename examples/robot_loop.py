"""A controller and a robot in two processes, connected by UDP at a fixed rate.

    .venv/bin/python examples/robot_loop.py

The robot is a virtual rig that applies the newest received pressure and sends the measured
displacement. The controller follows a slow wave. Both know the other's address in advance and
ignore all other senders. The robot refuses pressures outside its limits. On a real robot, the other
end is a microcontroller with the same packet format (see mckibben.stream.link).
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
from multiprocessing.connection import Connection

import numpy as np

import mckibben
from mckibben.blocks.feedback import FeedforwardFeedback
from mckibben.control import tune_pid
from mckibben.signals import decaying_triangle
from mckibben.stream import FixedRate, Step, UDPLink

RIG = "mas20-hanging"


def robot(pipe: Connection, period: float, duration: float) -> None:
    """Run the robot: step the rig at its own rate with the newest pressure."""
    rig = mckibben.load_rig(RIG).changed({"sample_time": period})
    readings = rig.reset(0)
    place = rig.outputs.index("displacement")
    limits = rig.limits("pressure")
    pressure = limits.low
    with UDPLink(size=1, limits=[(limits.low, limits.high)]) as link:
        pipe.send(link.address)
        link.accept(pipe.recv())  # ignore all other senders
        for _ in FixedRate(period, duration):
            wanted = link.newest()
            if wanted is not None:
                pressure = float(wanted[0])
            readings = rig.step({"pressure": pressure})
            link.send([readings[place]])


def controller(
    pipe: Connection, block: mckibben.Block, period: float, duration: float
) -> tuple[float, str]:
    """Follow a wave, and return the RMS error [mm] and the statistics of deadlines."""
    step, rate, errors = Step(block, period), FixedRate(period, duration), []
    measured = 0.0
    with UDPLink(pipe.recv(), size=1) as link:
        pipe.send(link.address)
        for k in rate:
            newest = link.newest()
            if newest is not None:
                measured = float(newest[0])
            reference = 12.0 - 6.0 * math.cos(2 * math.pi * k * period / 5.0)
            link.send(step([reference, measured]))
            errors.append(reference - measured)
    settled = np.array(errors)[len(errors) // 5 :]
    return float(np.sqrt(np.mean(settled**2))), str(rate.deadlines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--period", type=float, default=0.02, help="of control and robot [s]")
    parser.add_argument("--duration", type=float, default=10.0, help="[s]")
    chosen = parser.parse_args()
    rig = mckibben.load_rig(RIG)
    time = np.arange(3000) * 0.05
    pressure = decaying_triangle(time, low=0.0, high=5.0, period=20.0)
    recording = rig.run(mckibben.Recording({"pressure": pressure}, 0.05))
    inverse = mckibben.GPIEstimator().fit(recording).model_.inverse()
    pid = tune_pid(rig, sample_time=chosen.period)
    block = FeedforwardFeedback.of(inverse, pid)

    ours, theirs = multiprocessing.Pipe()
    context = multiprocessing.get_context("spawn")
    process = context.Process(target=robot, args=(theirs, chosen.period, chosen.duration + 1.0))
    process.start()
    error, kept = controller(ours, block, chosen.period, chosen.duration)
    process.join()
    print(f"Followed within {error:.2f} mm RMS: {kept}")


if __name__ == "__main__":
    main()

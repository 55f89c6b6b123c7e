"""A compensator between two topics of ROS 2, with rclpy.

    python3 examples/ros_node.py inverse.json --rate 100 --highest 6

The node receives references [mm] on ``reference`` and publishes pressures [bar] on ``pressure``, or 0 if
references stop.
For real-time use, `mckibben export ros2` writes a controller for ros2_control.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import rclpy
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

import mckibben
from mckibben.stream import Step


class Compensator(Node):  # type: ignore[misc]  # rclpy has no types
    """Steps a compensator at a fixed rate."""

    def __init__(self, block: mckibben.Block, chosen: argparse.Namespace) -> None:
        super().__init__("compensator")
        self.block, self.chosen = block, chosen
        self.step = Step(block, 1.0 / chosen.rate)
        self.reference, self.heard = np.empty(0), -np.inf
        self.create_subscription(Float64MultiArray, "reference", self.listen, 1)
        self.pressure = self.create_publisher(Float64MultiArray, "pressure", 1)
        self.create_timer(1.0 / chosen.rate, self.tick)

    def listen(self, message: Float64MultiArray) -> None:
        values = np.array(message.data, dtype=float)
        if values.size == len(self.block.inputs) and np.isfinite(values).all():
            self.reference, self.heard = values, time.monotonic()

    def tick(self) -> None:
        pressures = np.zeros(len(self.block.outputs))
        if time.monotonic() - self.heard < self.chosen.timeout:
            pressures = np.atleast_1d(self.step(self.reference))
        pressures = np.clip(pressures, 0.0, self.chosen.highest)
        self.pressure.publish(Float64MultiArray(data=pressures.tolist()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", help="inverse (JSON)")
    parser.add_argument("--rate", type=float, default=100.0, help="steps a second")
    parser.add_argument("--highest", type=float, required=True, help="pressure [bar]")
    parser.add_argument("--timeout", type=float, default=0.2, help="longest silence [s]")
    chosen = parser.parse_args()
    rclpy.init()
    rclpy.spin(Compensator(mckibben.load(chosen.model), chosen))


if __name__ == "__main__":
    main()

"""A compensator between two topics of ROS 2, with rclpy.

    python3 examples/ros_node.py inverse.json --rate 100 --highest 6

Takes references [mm] from ``reference`` and gives pressures [bar] on ``pressure``, both of type
`std_msgs/Float64MultiArray`. Before the first reference, and while none has come for a while, pressures
are the lowest. For real-time use, `mckibben export ros2` writes a controller for ros2_control.
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
        self.reference: np.ndarray | None = None
        self.heard = -np.inf
        self.create_subscription(Float64MultiArray, "reference", self.listen, 1)
        self.pressure = self.create_publisher(Float64MultiArray, "pressure", 1)
        self.create_timer(1.0 / chosen.rate, self.tick)

    def listen(self, message: Float64MultiArray) -> None:
        """Take a reference, if it is whole and finite."""
        values = np.array(message.data, dtype=float)
        if values.size == len(self.block.inputs) and np.isfinite(values).all():
            self.reference, self.heard = values, time.monotonic()

    def tick(self) -> None:
        """Publish the next pressures."""
        pressures = np.full(len(self.block.outputs), self.chosen.lowest)
        if self.reference is not None and time.monotonic() - self.heard < self.chosen.timeout:
            pressures = np.atleast_1d(self.step(self.reference))
        limited = np.clip(pressures, self.chosen.lowest, self.chosen.highest)
        self.pressure.publish(Float64MultiArray(data=limited.tolist()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", help="inverse (JSON)")
    parser.add_argument("--rate", type=float, default=100.0, help="steps a second")
    parser.add_argument("--lowest", type=float, default=0.0, help="[bar]")
    parser.add_argument("--highest", type=float, required=True, help="[bar]")
    parser.add_argument("--timeout", type=float, default=0.2, help="longest silence [s]")
    chosen = parser.parse_args()
    rclpy.init()
    rclpy.spin(Compensator(mckibben.load(chosen.model), chosen))


if __name__ == "__main__":
    main()

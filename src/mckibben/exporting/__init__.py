"""Code export of models: C99 for microcontrollers, FMUs for simulators, packages of ROS 2."""

from __future__ import annotations

from mckibben.exporting.c.project import export_c as export_c
from mckibben.exporting.c.serving import Serving as Serving
from mckibben.exporting.c.wiring import state_of as state_of
from mckibben.exporting.fmu.unit import export_fmu as export_fmu
from mckibben.exporting.ros2.package import export_ros2 as export_ros2

"""Code export of models: C99 for microcontrollers, FMUs for simulators, packages of ROS 2."""

from __future__ import annotations

from mckibben.export.c.project import export_c as export_c
from mckibben.export.c.serving import Serving as Serving
from mckibben.export.c.wiring import state_of as state_of
from mckibben.export.fmu.unit import export_fmu as export_fmu
from mckibben.export.ros2.package import export_ros2 as export_ros2

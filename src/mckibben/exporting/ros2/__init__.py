"""A compensator as a package of ROS 2: a chainable controller of ros2_control around exported C."""

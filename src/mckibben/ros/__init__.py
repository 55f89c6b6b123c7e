"""Topics of ROS 2 without installing ROS: messages over Cyclone DDS, a node, recording to MCAP."""

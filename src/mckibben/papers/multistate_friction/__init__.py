"""Multistate friction: static force, friction by direction, and feedforward with both."""

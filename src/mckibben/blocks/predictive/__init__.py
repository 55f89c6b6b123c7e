"""Compensators that look ahead, so that limits of pressure, rate and supply cost less."""

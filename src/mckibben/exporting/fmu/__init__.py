"""Blocks as functional mock-up units for co-simulation, by FMI 2.0."""

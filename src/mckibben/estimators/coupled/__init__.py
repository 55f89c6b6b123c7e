"""Identification of several muscles that move one another."""

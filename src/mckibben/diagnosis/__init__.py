"""Recordings and models diagnosed: what is in them, and what they miss."""

"""Identification of models made of relays."""

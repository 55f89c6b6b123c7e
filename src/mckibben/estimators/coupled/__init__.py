"""Identification of coupled muscles."""

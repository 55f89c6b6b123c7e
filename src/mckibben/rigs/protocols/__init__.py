"""Protocols of rigs that are of no paper; those of papers are in the papers' folders."""

"""Optimisers, one per kind of search."""

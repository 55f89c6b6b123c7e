"""Golden cases: what the package answers today, stored as data, and one tool that compares.

``python -m tests.golden`` runs every case and prints what moved, by how much, and within which
tolerance. See README.md in this folder.
"""

"""Identification of models made of play and stop operators."""

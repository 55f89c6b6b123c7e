"""Blocks without memory: polynomials, straight pieces, scale and sign."""

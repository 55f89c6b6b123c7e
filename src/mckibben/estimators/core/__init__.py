"""Estimators: settings, data, diagnostics, and models linear in most parameters."""

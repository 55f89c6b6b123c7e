"""Feedback laws as blocks, so that they are saved, streamed and exported like models."""

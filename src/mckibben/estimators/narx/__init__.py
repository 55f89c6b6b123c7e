"""NARX models: terms chosen on one-step errors, everything refined on free-running ones."""

"""Pages that are made from the code; see `docs/build.py`."""

"""The pages of the workbench, one module each: ``TITLE``, ``ICON`` and ``build(state)``."""

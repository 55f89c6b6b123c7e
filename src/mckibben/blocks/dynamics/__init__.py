"""Dynamic models from data: transfer functions, process models, and NARX."""

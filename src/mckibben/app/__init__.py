"""The workbench in the browser: data, loops, models, compensation and code over one folder."""

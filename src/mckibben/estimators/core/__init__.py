"""What an estimator is: settings, data, diagnostics, and models linear in most parameters."""

"""Linear dynamic models by prediction errors: ARX, ARMAX, output-error, Box-Jenkins, process models."""

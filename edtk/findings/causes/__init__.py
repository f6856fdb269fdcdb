"""Causes that explain residuals: alternatives to the model, each refitted and compared."""

"""Weights instead of whole experiments, with a bound that holds for every design."""

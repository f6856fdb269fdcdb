"""A second implementation of model, criteria and bounds, for checking certificates only.

It shares no code with the rest of the package: plain numpy, other formulas where there are others. An
error in the first implementation is thus not repeated here.
"""

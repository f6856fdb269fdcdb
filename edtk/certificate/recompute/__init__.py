"""A second implementation of model, criteria and bounds, for checking certificates only.

It shares no code with the rest of the package, and takes other formulas where there are others, so
that an error in the first implementation is not repeated here.
"""

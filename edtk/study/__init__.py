"""Studies: their keys, their checks, and the answers to them."""

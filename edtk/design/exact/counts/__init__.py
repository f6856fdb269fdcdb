"""Exact plans of a `Problem`: how often to measure each candidate, and how good plans can be."""

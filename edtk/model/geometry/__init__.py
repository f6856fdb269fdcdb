"""Geometric errors of a chain: lengths, offsets and axes that differ from the drawing."""

"""Geometry and springs from absolute positions of markers."""

"""Drawings into given axes, of which pictures and reports are put together."""

"""Instruments as functions of the joints, one kind of measured rows a file."""

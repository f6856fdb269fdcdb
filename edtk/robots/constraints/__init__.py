"""Constraints on calibration poses, one kind a file."""

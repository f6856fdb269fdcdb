"""Noise of measurements: tracker, repeatability of the robot, and what the model leaves out."""

"""Robots: chains, frames, joints, controllers, files that describe them, constraints and loads."""

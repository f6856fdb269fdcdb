"""Robots from URDF files: a tree of links and joints, and the chain between two of its links."""

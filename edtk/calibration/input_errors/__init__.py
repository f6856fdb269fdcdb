"""Measurements that are certainly wrong: copied rows, other poses, swapped columns."""

"""A batched interior-point method: many starts descend through the same array operations."""

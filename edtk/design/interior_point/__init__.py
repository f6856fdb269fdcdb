"""A batched interior-point method: many starts descend at once, under constraints."""

"""What looks wrong in sheets of positions, and in fits to them."""

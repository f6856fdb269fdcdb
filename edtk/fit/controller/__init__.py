"""How a controller counts the joints, from measured positions."""

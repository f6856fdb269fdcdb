"""Robot programs that exist: their targets, in which frames these are, and what is not known."""

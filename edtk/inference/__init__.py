"""What the measurements say (the paper's Sections 2 and 3)."""

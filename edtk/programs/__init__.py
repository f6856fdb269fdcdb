"""Robot programs: steps as data, and as the text of a brand, one brand a file."""

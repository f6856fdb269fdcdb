"""One question is a file, its answer is a table."""

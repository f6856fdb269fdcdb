"""Text for terminals: a file for each result, its function named after it."""

"""Tables for notebooks: a file for each result, its function named after it."""

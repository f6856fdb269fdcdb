"""Pictures of results: a file for each result, its function named after it."""

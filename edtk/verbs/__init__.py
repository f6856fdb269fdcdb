"""The verbs of the front door, one a file: what a command does, one call does."""

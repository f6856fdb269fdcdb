"""The verbs of the front door: what a command does, one call does."""

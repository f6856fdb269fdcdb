"""From a sheet of absolute positions to geometry, springs, predictions and commands."""

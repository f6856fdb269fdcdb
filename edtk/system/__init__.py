"""What every program needs: files that are written whole or not at all, workers, errors, array types."""

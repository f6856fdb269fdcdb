"""What every program needs: whole files, workers, errors, array types."""

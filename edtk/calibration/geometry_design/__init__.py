"""Plans of a study of geometry: which poses to measure, without and with a load."""

"""Plans in order, whose errors have a structure: split plots, strips, series, trends."""

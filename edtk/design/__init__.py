"""Which poses to measure (the paper's Section 4): problems, plans, and how plans are found."""

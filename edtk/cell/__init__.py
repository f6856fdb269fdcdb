"""The cell: a robot's bodies, what it carries and what stands around it; distances and ways."""

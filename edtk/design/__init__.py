"""Which experiments to make: problems, spaces, relaxed designs and exact plans, with bounds."""

"""From joint angles and wrench to the regressor of the compliances (the paper's Section 2)."""

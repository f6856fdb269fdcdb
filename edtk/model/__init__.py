"""The paper's Section 2: from joint angles and a wrench to the regressor of the compliances."""

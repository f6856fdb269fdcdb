"""
Compare criteria
================

A plan that is best for one criterion may be poor for another. Here plans of three experiments are
found for four criteria, and every plan is scored under all of them.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import edtk

study = edtk.load_study(Path(edtk.__file__).parents[1] / "studies" / "kr270_milling.toml")
names = ["rho0", "A", "D", "O2"]

# %%
# One plan for each criterion, all from the same seed.

plans = {name: edtk.plan(study, size=3, criterion=name, seed=1, workers=1) for name in names}
for found in plans.values():
    print(found)

# %%
# The efficiency of a plan under a criterion is the cost of the best of these plans, divided by
# its own cost.

values = {
    name: {key: edtk.evaluate(study, found.plan).criteria[key] for key in names}
    for name, found in plans.items()
}
costs = np.array([[values[plan][key] for key in names] for plan in names])
maximised = [edtk.criteria.get(key).sense == "max" for key in names]
costs[:, maximised] = 1 / costs[:, maximised]
efficiency = 100 * costs.min(axis=0) / costs

figure, ax = plt.subplots(figsize=(5, 4), layout="constrained")
image = ax.imshow(efficiency, vmin=0, vmax=100, cmap="viridis")
for row in range(len(names)):
    for column in range(len(names)):
        value = efficiency[row, column]
        colour = "black" if value > 60 else "white"
        ax.text(column, row, f"{value:.0f}", ha="center", va="center", color=colour)
ax.set_xticks(range(len(names)), names)
ax.set_yticks(range(len(names)), [f"plan for {name}" for name in names])
ax.set_title("Efficiency [%], by criterion")
figure.colorbar(image, ax=ax, label="efficiency [%]")

# %%
# The plan for O2, the condition number, is far from the best in the test pose. That is the
# message of the reference paper: choose the plan for what the robot shall do.

"""
Any linear model, with a bound
==============================

edtk does not need a robot. A problem is an array of regressor blocks, one block for each candidate
experiment. Here the candidates are a grid on the square, and the model is a full quadratic.
"""

import matplotlib.pyplot as plt
import numpy as np

import edtk
from edtk import criteria

# %%
# Candidates and model: ``y = k1 + k2 u + k3 v + k4 u^2 + k5 u v + k6 v^2 + noise``.

axis = np.linspace(-1, 1, 21)
u, v = (grid.ravel() for grid in np.meshgrid(axis, axis))
rows = np.stack([np.ones_like(u), u, v, u**2, u * v, v**2], axis=-1)
problem = edtk.Problem(rows[:, None, :], parameters=("1", "u", "v", "u2", "uv", "v2"))

# %%
# The optimal weights, with a proved bound on every design over these candidates.

design = edtk.relax(problem, "D")
print(design)
print(f"value {design.value:.6f}, bound {design.bound:.6f}, gap {design.gap:.1e}")

# %%
# Twelve whole experiments: apportion the weights, then exchange experiments as long as that helps.

criterion = criteria.create("D")
counts = edtk.apportion(design.weights, 12)
chosen, cost = edtk.exchange(problem, criterion, np.repeat(np.arange(problem.n), counts))
plan = np.bincount(chosen, minlength=problem.n)
value = float(criterion.value(problem.information(plan)))
print(f"value {value:.4f}, at most {12 * design.bound:.4f} is possible")

# %%
# The equivalence theorem as a picture: at the optimum no candidate has a sensitivity above p = 6,
# and the experiments sit where it is reached.

M = problem.information(design.weights)
sensitivity = problem.sensitivities(np.linalg.inv(M)).reshape(21, 21)
figure, ax = plt.subplots(figsize=(5.5, 4.4), layout="constrained")
picture = ax.contourf(axis, axis, sensitivity, levels=12, cmap="viridis")
ax.scatter(
    u[plan > 0],
    v[plan > 0],
    s=60 * plan[plan > 0],
    color="w",
    clip_on=False,
    zorder=3,
    edgecolor="k",
    label="experiments",
)
ax.set(xlabel="u", ylabel="v", title="Sensitivity of the D-optimal design")
ax.set(xticks=[-1, -0.5, 0, 0.5, 1], yticks=[-1, -0.5, 0, 0.5, 1])
ax.legend(loc="upper center", ncols=2, bbox_to_anchor=(0.5, -0.15))
figure.colorbar(picture, ax=ax, label="sensitivity (at most 6)")

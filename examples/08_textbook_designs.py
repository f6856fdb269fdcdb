"""
Examples of other packages, with their numbers
==============================================

A design that another package prints is a few lines here. Each number that is published is asserted.
:doc:`/howto/coming_from` has their calls beside ours.
"""

import matplotlib.pyplot as plt
import numpy as np

import edtk
from edtk import criteria

# %%
# AlgDesign's vignette: fifteen runs of a quadratic in three factors of five levels. It prints
# D = 3.675919, and for its I-optimal runs I = 8.096772. Ours are as good, and better.

values = [-2, -1, 0, 1, 2]
cube = edtk.candidates.full_factorial({"A": values, "B": values, "C": values})
quadratic = edtk.Problem.from_frame(cube, "(A + B + C)**2 + I(A**2) + I(B**2) + I(C**2)")
best_d = edtk.plan(quadratic, size=15, criterion="D")
mean = criteria.create("I", points=quadratic.regressors(cube))
best_i = edtk.plan(quadratic, size=15, criterion=mean)
print(f"D = {best_d.value / 15:.6f}, I = {15 * best_i.value:.6f}")
assert best_d.value / 15 > 3.675919 * (1 - 1e-6)
assert 15 * best_i.value < 8.096772

# %%
# Both plans side by side, against the bound of each criterion.

print(edtk.compare({"D": best_d, "I": best_i}).to_frame().T)
best_i.plot(kind="variance", factors=("A", "B"))

# %%
# optedr's first example: two enzymes. It prints 0.8332604, 10 and 10, 0.8332352 and 10, 10.

dose = {"x1": (0.1, 10), "x2": (0.1, 10)}
enzymes = "Vmax * x1 * x2 / ((K1 + x1) * (K2 + x2))"
two = edtk.Region.of_model(enzymes, {"Vmax": 1, "K1": 1, "K2": 1}, dose)
design = edtk.relax(two, "D")
print(design.to_frame())
np.testing.assert_allclose(np.sort(design.points.ravel())[:2], [0.83325, 0.83325], atol=2e-4)

# %%
# ICAOD's example of mixed inhibition: four points of equal weight.

inhibited = edtk.Region.of_model(
    "V * S / (Km * (1 + J / Kic) + S * (1 + J / Kiu))",
    {"V": 1.5, "Km": 5.2, "Kic": 3.4, "Kiu": 5.6},
    {"S": (0, 30), "J": (0, 60)},
)
found = edtk.relax(inhibited, "D")
print(found.to_frame())
printed = [[3.861406, 0], [4.600633, 4.168798], [30, 0], [30, 5.111376]]
np.testing.assert_allclose(found.points, printed, atol=1e-3)

# %%
# ICAOD's standardized maximin design: a loglinear model of which one parameter lies between 1 and
# 15. Its manual prints points at 0, 4.2494, 17.0324 and 149.9090; ours are best at their worst.

ranges = {"t0": 2.0, "t1": 2.0, "t2": (1, 15)}
unsure = edtk.Region.of_model("t0 + t1 * log(x + t2)", ranges, (0, 150), robust="maximin")
safe = edtk.relax(unsure)
print(safe.worst, safe.to_frame(), sep="\n")
heavy = safe.weights[safe.weights > 1e-3]
np.testing.assert_allclose(heavy, [0.3204, 0.1207, 0.2293, 0.3296], atol=0.02)

# %%
# optedr's first rivals: Michaelis and Menten against a line. It prints 1.127578 and 5 with the
# weights 0.8159831 and 0.1840169, and the divergence 0.155804, which is half of our deviance.

rivals = edtk.Region.of_rivals(
    "Vmax * x / (Km + x)", {"Vmax": 2, "Km": 1}, "a * x", {"a": (0.2, 2.5)}, (0.1, 5)
)
told = edtk.relax(rivals)
print(told.to_frame())
np.testing.assert_allclose(told.worst.value / 2, 0.155804, rtol=4.3e-5)

# %%
# A textbook case of OptimalDesign: for A a parabola is measured with weights 1/4, 1/2, 1/4.

x = np.linspace(-1, 1, 101)
parabola = edtk.relax(edtk.Problem(np.vander(x, 3)[:, None, :]), "A")
np.testing.assert_allclose(parabola.weights[[0, 50, 100]], [0.25, 0.5, 0.25], atol=1e-6)

# %%
# pyoptex's quickstart: twenty runs of a factor with three names and two numbers. Its reference for
# det(M)^(1/p) is 9.361715, and 8.432136 where the names change in five whole plots.

runs = edtk.candidates.full_factorial({"A": ["L1", "L2", "L3"], "B": [-1, 0, 1], "D": [-1, 0, 1]})
mixed = edtk.Problem.from_frame(runs, "C(A, contr.sum) * (B + D) + B:D + I(B**2) + I(D**2)")
free = edtk.plan(mixed, size=20, starts=32)
whole = edtk.plan(mixed, size=20, errors=edtk.Errors.split_plot("A", 5, variance=0.1), starts=32)
print(free.headline(), whole.headline(), sep="\n")
assert free.value >= 9.361714707695096
assert whole.value >= 8.432135863585366 * (1 - 1e-9)

# %%
# BoFire's mixture within two constraints: its D-optimal runs lie on these four vertices.

within = [({"x1": 5, "x2": 4}, None, 3.9), ({"x1": -20, "x2": 5}, None, -3)]
parts = {"x1": (0, 1), "x2": (0.1, 1), "x3": (0, 0.6)}
shares = edtk.candidates.extreme_vertices(parts, within, centroids=1)
twelve = edtk.plan(edtk.Problem.from_frame(shares, "0 + x1 + x2 + x3"), size=12)
print(twelve.to_frame())
printed = [[0.2, 0.2, 0.6], [0.3, 0.6, 0.1], [0.7, 0.1, 0.2], [0.3, 0.1, 0.6]]
for share in twelve.to_frame()[["x1", "x2", "x3"]].to_numpy():
    assert np.abs(share - printed).max(axis=1).min() < 1e-9

# %%
# What skpr and JMP show of a screening design: power, and which products hide behind a factor.

corners = edtk.candidates.full_factorial([2] * 5)
screen = edtk.plan(edtk.Problem.from_frame(corners, "A + B + C + D + E"), size=8, starts=20)
screen.plot(kind="power")
screen.plot(kind="alias")
plt.show()

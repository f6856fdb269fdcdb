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
# A textbook case of OptimalDesign: for A a parabola is measured with weights 1/4, 1/2, 1/4.

x = np.linspace(-1, 1, 101)
parabola = edtk.relax(edtk.Problem(np.vander(x, 3)[:, None, :]), "A")
np.testing.assert_allclose(parabola.weights[[0, 50, 100]], [0.25, 0.5, 0.25], atol=1e-6)

# %%
# What skpr and JMP show of a screening design: power, and which products hide behind a factor.

corners = edtk.candidates.full_factorial([2] * 5)
screen = edtk.plan(edtk.Problem.from_frame(corners, "A + B + C + D + E"), size=8, starts=20)
screen.plot(kind="power")
screen.plot(kind="alias")
plt.show()

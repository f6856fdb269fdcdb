"""
Nonlinear models over a continuous region
=========================================

When to measure, and at which dose? The points of these experiments can take any value between
limits. A region is a model as a function of its points: the derivatives of the prediction by the
parameters, at a first guess of them. Three classics follow.
"""

import matplotlib.pyplot as plt
import numpy as np

import edtk
from edtk import criteria

# %%
# Michaelis and Menten: the velocity V s/(K + s) of an enzyme. For D half of the experiments are at
# the largest concentration b, and half at K b/(2 K + b).

V, K, b = 2.0, 1.0, 4.0


def enzyme(x):
    s = x[:, 0]
    return np.stack([s / (K + s), -V * s / (K + s) ** 2], axis=-1)


region = edtk.Region(enzyme, 0, b, parameters=("V", "K"), variables=("concentration",))
design = edtk.relax(region, "D")
print(design.summary())
print("theory:", K * b / (2 * K + b), b)

# %%
# The equivalence theorem: no concentration has a sensitivity above that of the design's points.

design.plot()

# %%
# If only K matters, more of the experiments go to the lower concentration.

only_k = criteria.create("A", interest=[0.0, 1.0])
print(edtk.relax(region, only_k).summary())

# %%
# Box and Lucas: the yield of an intermediate product between two reactions of rates 0.7 and 0.2.
# Two times of measurement are best, 1.23 and 6.86.

f, g = 0.7, 0.2


def intermediate(x):
    t = x[:, 0]
    early, late = np.exp(-f * t), np.exp(-g * t)
    by_f = f * t * early / (f - g) - g * (late - early) / (f - g) ** 2
    by_g = f * (late - early) / (f - g) ** 2 - f * t * late / (f - g)
    return np.stack([by_f, by_g], axis=-1)


reaction = edtk.Region(intermediate, 0, 20, parameters=("f", "g"), variables=("time",))
print(edtk.relax(reaction, "D").summary())

# %%
# Seven whole experiments, with the bound on every plan of seven.

plan = edtk.plan(reaction, size=7, criterion="D")
print(plan.summary())

# %%
# A yes-or-no answer to two doses together, P = 1/(1 + exp(-(x1 + x2))): its information P (1 - P)
# depends on the point, so that its root is a factor of the rows.


def answer(x):
    weight = 1 / (2 * np.cosh((x[:, 0] + x[:, 1]) / 2))
    return weight[:, None] * np.column_stack([np.ones(len(x)), x])


doses = edtk.Region(answer, [-5, -2], [5, 2], variables=("first dose", "second dose"))
edtk.plan(doses, size=6, criterion="D").plot()
plt.show()

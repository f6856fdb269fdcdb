"""
From a data frame
=================

Candidates often come as a table: what could be measured, a row each. This example chooses eight
rows out of two hundred, so that a linear model with an interaction is estimated as well as
possible. Formulas need the package formulaic (`pip install 'edtk[frames]'`).
"""

import numpy as np
import pandas as pd

import edtk
from edtk import criteria

rng = np.random.default_rng(3)
table = pd.DataFrame(
    {
        "temperature_C": rng.uniform(20, 80, 200).round(1),
        "pressure_bar": rng.uniform(1, 5, 200).round(2),
    }
)
table.head()

# %%
# The model: columns that are scaled to order one, and their product. The columns of the model
# matrix name the parameters.

table["t"] = (table["temperature_C"] - 50) / 30
table["p"] = (table["pressure_bar"] - 3) / 2
problem = edtk.Problem.from_frame(table, "1 + t * p")
problem.parameters

# %%
# Optimal weights give the bound, as rows of the table.

design = edtk.relax(problem, "A")
design.to_frame().round(3)

# %%
# The equivalence theorem as a picture: weight is only where the sensitivity is the largest.

design.plot(x="t")

# %%
# An exchange among the rows gives the plan: the rows to measure, and how often.

criterion = criteria.create("A")
start = np.repeat(np.arange(problem.n), edtk.apportion(design.weights, 8))
chosen, cost = edtk.exchange(problem, criterion, start)
efficiency = design.bound / 8 / float(cost)
print(f"efficiency {100 * efficiency:.1f} % of the best that is possible")
problem.to_frame(np.bincount(chosen, minlength=problem.n), "repeats")

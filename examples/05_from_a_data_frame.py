"""
From a data frame
=================

Candidates often come as a table: what could be measured, a row each. This example chooses eight
rows out of two hundred, so that a linear model with an interaction is estimated as well as
possible.
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
# The model matrix: scale the columns to order one, then write one column for each parameter.

t = (table["temperature_C"] - 50) / 30
p = (table["pressure_bar"] - 3) / 2
model = pd.DataFrame({"1": 1.0, "temperature": t, "pressure": p, "interaction": t * p})
problem = edtk.Problem(model.to_numpy()[:, None, :], parameters=tuple(model.columns))

# %%
# Optimal weights give the bound; an exchange among the rows gives the plan.

design = edtk.relax(problem, "A")
criterion = criteria.create("A")
start = np.repeat(np.arange(problem.n), edtk.apportion(design.weights, 8))
chosen, cost = edtk.exchange(problem, criterion, start)
efficiency = design.bound / 8 / float(cost)
print(f"efficiency {100 * efficiency:.1f} % of the best that is possible")

# %%
# The rows to measure, and how often.

counts = pd.Series(chosen).value_counts().sort_index()
table.loc[counts.index].assign(repeats=counts)

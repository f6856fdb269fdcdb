"""What is certainly wrong in measurements that can be read: copied rows, other poses, swapped columns."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, permutations, product

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import poisson

from edtk.calibration.match_plan import match_plan, resolution_of
from edtk.design.plan import Plan
from edtk.inference.identification import Identification
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.measurements import Measurements
from edtk.study.study import Study
from edtk.tables.pose_table import WRENCH_COLUMNS, pose_columns, pose_factors
from edtk.tables.sheet_columns import DEFLECTION_COLUMNS, MARKER_COLUMNS, ROTATION_COLUMNS

Array = NDArray[np.float64]

SUSPECT = 3.0  # residuals over sigma beyond which other readings of the columns are tried
BETTER = 4.0  # factor by which such a reading must reduce the residuals
CHANCE = 1e-3  # probability of equal rows up to which they are copies
ENOUGH = 1000  # rows on which readings are compared


def find_input_error(
    study: Study, data: Measurements, fit: Identification, plan: Plan | None = None
) -> str | None:
    """The first mistake in measurements, with its rows and columns, and what was expected; None where there is none.

    Args:
        study: The question.
        data: The measurements.
        fit: What they gave.
        plan: The plan that was to be carried out.
    """
    found = None if plan is None else _other_pose(study, data, plan)
    return found or _copies(data) or _swapped(study, data, fit)


def _other_pose(study: Study, data: Measurements, plan: Plan) -> str | None:
    """The first measured pose that is not planned, with the column where it is farthest from the nearest one."""
    found = match_plan(study, data, plan)
    rows = np.flatnonzero(found.distance > resolution_of(study))
    if not len(rows):
        return None
    row, nearest = rows[0], found.pose[rows[0]]
    off = np.abs(data.q[row] - plan.q[nearest]) / pose_factors(study.robot)
    column = pose_columns(study.robot)[int(off.argmax())]
    more = f"; {len(rows) - 1} more rows are not either" if len(rows) > 1 else ""
    return (
        f"row {row + 1}, column {column}: the pose is not in the plan; the nearest planned one, row {nearest + 1}, "
        f"is {found.distance[row]:.3g} {column.rsplit('_')[-1]} away{more}"
    )


def _copies(data: Measurements) -> str | None:
    """Rows that are the same to the last digit, if there are more than the resolution of the readings explains."""
    text, chance = twins(data)
    return f"{text}; expected measurements anew" if text and chance <= CHANCE else None


def twins(data: Measurements) -> tuple[str, float]:
    """Rows that are the same to the last digit, in words, and the probability of so many.

    Two repetitions agree in a coordinate of resolution d with probability ``d / (2 sqrt(pi) sigma)`` at most, and the
    number of agreeing pairs is about Poisson's.
    """
    where = np.hstack([data.q, data.wrench, data.marker]) + 0.0
    pose = pd.util.hash_pandas_object(pd.DataFrame(where), index=False)
    row = pd.util.hash_pandas_object(
        pd.DataFrame(np.hstack([where, data.deflection + 0.0])), index=False
    )
    first = ~row.duplicated().to_numpy()
    if first.all():
        return "", 1.0
    pairs, same = (
        float((n * (n - 1) / 2).sum()) for n in (pose.value_counts(), row.value_counts())
    )
    parts = [(data.deflection[:, :3], 1e3), (data.deflection[:, 3:], 180 / np.pi)]
    steps = [np.full(x.shape[1], _resolution(x * factor) / factor) for x, factor in parts if x.size]
    agree = np.concatenate(steps) / (2 * np.sqrt(np.pi) * data.sigma.mean(axis=0))
    later = int(np.flatnonzero(~first)[0])
    earlier = int(np.flatnonzero(row.to_numpy() == row.iloc[later])[0])
    more = int((~first).sum()) - 1
    others = f", and {more} more rows have such a twin" if more else ""
    text = f"row {later + 1} is row {earlier + 1} to the last digit, in all columns{others}"
    return text, float(poisson.sf(same - 1, pairs * np.minimum(agree, 1.0).prod()))


def _resolution(values: Array) -> float:
    """The decimal step 10^-d, d <= 9, that all values are multiples of."""
    for d in range(9):
        scaled = values * 10.0**d
        if np.abs(scaled - np.rint(scaled)).max() < 1e-4:
            return float(10.0**-d)
    return 1e-9


def _swapped(study: Study, data: Measurements, fit: Identification) -> str | None:
    """Columns that fit much better if they are read otherwise, or that make every compliance negative by far."""
    if (fit.unbounded < -3 * fit.std).all():
        return (
            "the columns of loaded and unloaded positions look swapped, or the load has the wrong sign: every "
            "compliance comes out negative; expected positive ones"
        )
    if fit.dof < 5 or not fit.scale > SUSPECT:
        return None
    rows = data
    if len(data) > ENOUGH:  # by chance, as every second one may be of the same pose
        rows = data[np.sort(np.random.default_rng(0).choice(len(data), ENOUGH, replace=False))]
    before = _size(study, rows, bounded=False)
    sizes = {words: _size(study, other) for words, other in _readings(study, rows)}
    best = min(sizes.values())
    if not best * BETTER <= before < np.inf:
        return None
    words, after = next((words, size) for words, size in sizes.items() if size <= 1.2 * best)
    return f"{words}, which makes the residuals {after:.3g} times sigma instead of {before:.3g}"


def _size(study: Study, data: Measurements, bounded: bool = True) -> float:
    """Residuals in units of sigma, root mean square; inf where compliances are open, or negative by far if bounded."""
    A = data.regressor(study.model)
    try:
        whitened = Whitened.of(A, data.sigma, study.model.parameters)
    except SingularPlanError:
        return np.inf
    k = whitened.solve(data.deflection)
    z = (data.deflection - A @ k) * whitened.weight
    size = float(np.sqrt((z**2).sum() / max(z.size - len(k), 1)))
    if not bounded:
        return size
    negative = k < -3 * max(size, 1.0) * np.sqrt(np.diag(whitened.covariance))
    return np.inf if negative.any() else size


def _readings(study: Study, data: Measurements) -> Iterator[tuple[str, Measurements]]:
    """Other ways of reading the columns, the likeliest first, in words and in numbers."""
    moved = data.deflection
    for i, j in combinations(range(3), 2):
        other = _exchanged(moved, i, j)
        a, b = DEFLECTION_COLUMNS[i], DEFLECTION_COLUMNS[j]
        yield (
            _words(f"{a} and {b} (or the positions in {'xyz'[i]} and {'xyz'[j]})"),
            replace(data, deflection=other),
        )
    joints = [j for j in range(study.robot.n) if j not in study.fixed]
    kinds, names = [joint.kind for joint in study.robot.joints], pose_columns(study.robot)
    for i, j in combinations(joints, 2):
        if kinds[i] == kinds[j]:
            yield _words(f"{names[i]} and {names[j]}"), replace(data, q=_exchanged(data.q, i, j))
    for i, j in [*combinations(range(3), 2), *combinations(range(3, 6), 2)]:
        if data.wrench[:, [i, j]].any():
            words = _words(f"{WRENCH_COLUMNS[i]} and {WRENCH_COLUMNS[j]}")
            yield words, replace(data, wrench=_exchanged(data.wrench, i, j))
    for i, j in combinations(range(3, moved.shape[1]), 2):
        yield (
            _words(f"{ROTATION_COLUMNS[i - 3]} and {ROTATION_COLUMNS[j - 3]}"),
            replace(data, deflection=_exchanged(moved, i, j)),
        )
    if data.marker.any():
        for i, j in combinations(range(3), 2):
            words = _words(f"{MARKER_COLUMNS[i]} and {MARKER_COLUMNS[j]}")
            yield words, replace(data, marker=_exchanged(data.marker, i, j))
        words = f"columns {', '.join(MARKER_COLUMNS)} look as if they were in metres; expected millimetres"
        yield words, replace(data, marker=1e3 * data.marker)
    for order, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        read = [
            f"{'-' * (s < 0)}{DEFLECTION_COLUMNS[i]}" for i, s in zip(order, signs, strict=True)
        ]
        handed = np.linalg.det(np.eye(3)[list(order)]) * np.prod(
            signs
        )  # rotation vectors are axial
        turned = [
            s * part[:, order] * signs
            for s, part in ((1, moved[:, :3]), (handed, moved[:, 3:]))
            if part.size
        ]
        words = f"columns {', '.join(DEFLECTION_COLUMNS)} look as if they were of a frame with other axes than the "
        yield (
            f"{words}robot's; expected them to be {', '.join(read)}",
            replace(data, deflection=np.hstack(turned)),
        )


def _words(columns: str) -> str:
    return f"columns {columns} look swapped; expected them the other way round"


def _exchanged(x: Array, i: int, j: int) -> Array:
    """The same with two columns exchanged."""
    other = x.copy()
    other[:, [i, j]] = x[:, [j, i]]
    return other

"""How long the check of a certificate takes, known from its sizes before it begins.

The rates are those of one core of a usual machine, in microseconds, rounded up. They need not be
right to better than a factor of two: they keep a small file from keeping a machine busy for hours.
"""

import numpy as np

from edtk.certificate.recompute.setting import Setting

MOST_SECONDS = 30.0
PER_JOINT = 0.25  # of a sample's test of feasibility
PER_EXCLUDED = 0.3
PER_FRAME = 0.7  # of one joint, for one instrument
PER_COLUMN = 0.2  # of a parameter of geometry, for one instrument
PER_CUBE = 1e-3  # of a matrix: of a decomposition, by the cube of its order
PER_SQUARE = 0.02  # of a matrix that is filled


def of_sample(setting: Setting) -> float:
    """Time to draw a sample, and to see whether it is feasible [us]."""
    return PER_JOINT * len(setting.chain.axes) + PER_EXCLUDED * len(setting.workspace.excluded)


def of_experiment(setting: Setting, multipliers: int = 1) -> float:
    """Time for the rows of an experiment, and for its sensitivities [us]."""
    measured = len(setting.sigma)
    instruments = 1 if setting.physics is None else len(setting.physics.sensors)
    columns = 0 if setting.geometry is None else setting.p
    rows = instruments * (PER_FRAME * len(setting.chain.axes) + PER_COLUMN * columns)
    if setting.noise is not None:
        rows += PER_CUBE * measured**3 + PER_SQUARE * measured**2
    each = measured * (PER_SQUARE * setting.p + PER_CUBE / 5 * setting.p**2)
    return rows + multipliers * each


def of_rows(setting: Setting, experiments: int) -> float:
    """Time for the value of a design, whose rows are decomposed together [us]."""
    rows = experiments * len(setting.sigma)
    visits = 0.0 if setting.noise is None else PER_SQUARE * len(setting.fixed) * experiments**2
    return experiments * of_experiment(setting) + PER_CUBE * rows * setting.p**2 + visits


def of_bounds(setting: Setting, multipliers: int, is_g: bool) -> float:
    """Time for the closed forms of the bounds [us]."""
    decompositions = 60.0 if is_g else 8.0
    return float(multipliers * decompositions * PER_CUBE * np.power(float(setting.p), 3))


def require(microseconds: float, what: str) -> None:
    """Refuse what takes too long.

    Raises:
        ValueError: It does; names what, and both times.
    """
    seconds = microseconds / 1e6
    if not seconds <= MOST_SECONDS:
        message = f"{what} take about {seconds:.2g} s to check, more than the {MOST_SECONDS:g} s"
        raise ValueError(f"{message} that a certificate may take")

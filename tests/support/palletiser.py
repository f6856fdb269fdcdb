"""A palletiser by its own mechanics: lengths and angles, and energies that scipy minimises.

It shares no code with the models: heights and radii of two arms that lean by the angles of their
motors, and the least energy of springs, load and weights over these angles. Derivatives are those
of complex steps, which are exact.
"""

import numpy as np
from scipy.optimize import root

UPPER, FOREARM = 1.25, 1.40
MASSES = np.array([160.0, 130.0, 45.0, 15.0])
TOOL = np.array([0.30, 0.05, 0.10])


def point(a, tool=TOOL):
    """The tool point (3,) where the motors stand at a (4,): arms that lean, and a level flange."""
    x = 0.3 + UPPER * np.sin(a[1]) + FOREARM * np.cos(a[2]) + 0.25
    z = 0.8 + UPPER * np.cos(a[1]) - FOREARM * np.sin(a[2]) - 0.2 - tool[2]
    x = x + tool[0] * np.cos(a[3]) - tool[1] * np.sin(a[3])
    y = -tool[0] * np.sin(a[3]) - tool[1] * np.cos(a[3])
    return np.array([np.cos(a[0]) * x - np.sin(a[0]) * y, np.sin(a[0]) * x + np.cos(a[0]) * y, z])


def heights(a):
    """Heights of the centres of the four bodies that move up and down, but for constants."""
    elbow = UPPER * np.cos(a[1])
    wrist = elbow - FOREARM * np.sin(a[2])
    return np.array([0.6 * np.cos(a[1]), elbow - 0.5 * np.sin(a[2]), wrist, wrist])


def energy(a, q, k, force, tool=TOOL, masses=MASSES):
    """Energy of springs between motors at q and arms at a, of a dead force and of the weights."""
    springs = ((a - q) ** 2 / (2 * k)).sum()
    return springs - force @ point(a, tool) + 9.80665 * masses @ heights(a)


def slope(function, a):
    """Derivatives by complex steps."""
    return np.array([function(a + 1e-30j * e).imag / 1e-30 for e in np.eye(len(a))])


def at_rest(q, k, force, tool=TOOL, masses=MASSES):
    """Angles of least energy (4,)."""

    def height(a):
        return energy(a, q, k, force, tool, masses)

    a = q + root(lambda theta: k * slope(height, q + theta), np.zeros(4), tol=1e-15).x
    around = [height(a + 1e-3 * e) for e in np.vstack([np.eye(4), -np.eye(4)])]
    assert min(around) > height(a)
    return a

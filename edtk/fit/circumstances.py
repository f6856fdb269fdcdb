"""What no reading of a calibration tells, and by how much all that it takes is off then."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from edtk.measure.expected_error import AssumedJoint
from edtk.measure.parameters import Parameter
from edtk.system.typing import Array, Indices

RIGID = "rigid_joints"
UNTOLD = ("load", "tool", "drift", RIGID)


class Loads(Protocol):
    """What loads the joints."""

    def __call__(self, q: Array, wrench: Array) -> Array:
        """Loads (m, s) of the free joints [N m or N] in poses q (m, n or s), under wrenches (m, 6).

        The first n are those of the joints that motors turn, and the rest of the elastic ones.
        """


@dataclass(frozen=True, eq=False)
class Circumstances:
    """Errors of parameters, and of what is taken as it is, by what causes them.

    A circumstance u that is off by a standard deviation s changes readings by ``D s``, and the
    parameters by ``A+ D s`` with the weighted least-squares inverse A+. One that is in the tasks,
    too, as the spring of a joint that counts as rigid, is off there by s itself: of each cause
    there is a root ``E = (A+ D s; -s)``, taken less true, and an error in a pose is ``(J J_o) E``.

    Attributes:
        joints: The joints (a,) that are not identified.
        others: Parameters (o,) that are taken as they are: the springs of these joints, and places
            of markers that count as known.
        roots: Errors (p + o, c) by cause, in the parameters' units; causes are the parts of an
            `ErrorBudget`. That of joints that count as rigid has a column for each of these.
        loads: What loads the joints, whether or not the study asks for springs.
        untold: What of it bends joints that count as rigid, and no reading tells.
    """

    joints: tuple[AssumedJoint, ...]
    others: tuple[Parameter, ...]
    roots: Mapping[str, Array]
    loads: Loads
    untold: Loads

    @property
    def rigid(self) -> tuple[AssumedJoint, ...]:
        """The joints that count as rigid, in the order of their columns."""
        return tuple(one for one in self.joints if one.rigid)

    def among(self, own: Indices, of: tuple[str, ...] = ()) -> "Circumstances":
        """The same of some of the parameters, and of the places of some markers.

        Args:
            own: Which parameters (p,).
            of: The markers; none by default.
        """
        p = next(iter(self.roots.values())).shape[0] - len(self.others)
        kept = [i for i, one in enumerate(self.others) if one.place != "tool" or one.of in of]
        rows = np.array([*own, *(p + i for i in kept)], dtype=int)
        return replace(
            self,
            others=tuple(self.others[i] for i in kept),
            roots={name: E[rows] for name, E in self.roots.items()},
        )

"""The power of a plan to notice a fault, and the experiment that would add most to it."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from edtk.calibration.causes.families_with_known import families_with_known
from edtk.calibration.causes.family import Family
from edtk.calibration.with_candidates import with_candidates
from edtk.design.detection import LEVEL, Detection
from edtk.design.plan import Plan
from edtk.inference.distributions import chi_square_quantile, noncentral_chi_square_tail
from edtk.inference.least_squares import Whitened
from edtk.inference.measurements import Measurements
from edtk.inference.whiten import RowNoise
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices

UNITS = {"mm": 1e-3, "deg": np.pi / 180, "%": 1e-2}
# Unit of the size of each fault; those of a joint mean the joint in which it is hardest to see.
FAULTS = {
    "load_size": "%",
    "load_direction": "deg",
    "tool_x": "mm",
    "tool_y": "mm",
    "tool_z": "mm",
    "frame_rotation": "deg",
    "drift": "mm",
    "torque_sign": "%",
    "backlash": "deg",
}


@dataclass(frozen=True)
class SizedFault:
    """A fault with its size.

    Attributes:
        name: Its name.
        size: Its size, in its unit.
        unit: That unit.
    """

    name: str
    size: float
    unit: str


def sized_faults(
    study: Study,
    given: Mapping[str, str],
    units: Mapping[str, str] = FAULTS,
    by_springs: Collection[str] | None = None,
) -> tuple[SizedFault, ...]:
    """Read sizes of faults.

    Args:
        study: The study, whose [simulation] faults are judged by.
        given: Sizes with units, like "5mm", "2deg" or "3%", by the name of the fault; "load" is
            short for "load_size".
        units: Units of the faults that there are.
        by_springs: Those that are judged by compliances; default to all.

    Raises:
        UserError: The study has no [simulation]; a fault or a unit is not known.
    """
    found = tuple(
        _sized("load_size" if name == "load" else name, size, units) for name, size in given.items()
    )
    judged = any(by_springs is None or fault.name in by_springs for fault in found)
    if judged and study.specification.simulation is None:
        message = "expected a table with compliances, by which faults are judged"
        raise study.error("simulation", message)
    return found


def detect(study: Study, plan: Plan, faults: tuple[SizedFault, ...]) -> tuple[Detection, ...]:
    """Find how likely faults of a calibration would be noticed in the measurements of a plan.

    A fault of size c adds ``D c`` to the measurements. Of that the residuals show the part that the
    compliances do not take up, ``(I - QQ') D c``; its squared length in units of sigma is the
    noncentrality of the chi-square statistic that tests for the fault.

    Args:
        study: The study; its [simulation] says how compliant the joints are.
        plan: All experiments.
        faults: Faults with their sizes.

    Returns:
        The detections in the order of the faults.

    Raises:
        SingularPlanError: The plan leaves a compliance open.
    """
    if not faults:
        return ()
    m, both = with_candidates(study, plan)
    A = both.regressor(study.model)
    known = tuple(families_with_known(study.model, both, A, study.compliances, study.known))
    return tuple(_detection(study, m, both, A, known, fault) for fault in faults)


def _detection(
    study: Study,
    m: int,
    both: Measurements,
    A: Array,
    known: tuple[Family, ...],
    fault: SizedFault,
) -> Detection:
    """The power of the first m rows, and with each of the experiments behind them."""
    named = [family for family in known if family.cause == fault.name]
    if named and not named[0].joint:
        named = named[:1]  # of the drifts the one that all readings share
    if not named:
        # Compliances take up a load of another size in full, in every plan, where none of them is
        # known; and a fault that depends on the sign of a torque is not there where no torque
        # changes its sign.
        return Detection(fault.name, fault.size, fault.unit, LEVEL, None, LEVEL)
    size = fault.size * UNITS[fault.unit]

    def power(rows: Indices, family: Family, D: Array) -> float:
        """Power of some rows against one fault."""
        return _power(A[rows], D[rows], both.noise[rows], study.model.parameters, family.dims)

    changes = [
        family.derivative_at_zero(study.compliances) @ np.full(family.dims, size / family.dims**0.5)
        for family in named
    ]
    planned = np.arange(m)
    powers = [power(planned, *pair) for pair in zip(named, changes, strict=True)]
    hardest = int(np.argmin(powers))
    more = np.arange(m, len(both)).reshape(-1, len(study.model.instruments))  # an experiment each
    with_one = [power(np.append(planned, one), named[hardest], changes[hardest]) for one in more]
    best = int(np.argmax(with_one))
    helps = with_one[best] > powers[hardest]
    return Detection(
        fault.name,
        fault.size,
        fault.unit,
        powers[hardest],
        both.q[more[best, 0]] if helps else None,
        max(with_one[best], powers[hardest]),
        named[hardest].joint,
    )


def _power(A: Array, D: Array, sigma: RowNoise, parameters: tuple[str, ...], dims: int) -> float:
    """Probability that a change D (m, rows) of the measurements is noticed."""
    whitened = Whitened.of(A, sigma, parameters)
    noncentrality = float((whitened.residual(D) ** 2).sum())
    threshold = float(chi_square_quantile(1 - LEVEL, dims))
    return noncentral_chi_square_tail(threshold, dims, noncentrality)


def _sized(name: str, size: str, units: Mapping[str, str]) -> SizedFault:
    """A fault with the number that is written before its unit."""
    if name not in units:
        message = f"no fault {name!r}; expected one of {', '.join(units)}"
        raise ArgumentError(message, argument="detect")
    number, unit, rest = size.partition(units[name])
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if not unit or rest or not np.isfinite(value):
        message = f"{name}={size}: expected a number with its unit, {units[name]}"
        raise ArgumentError(message, argument="detect")
    if value == 0:
        raise ArgumentError(f"{name}={size}: expected a size other than 0", argument="detect")
    return SizedFault(name, value, units[name])

"""What a machine is told of a sheet that is refused, as its columns look misread."""

from typing import Any

from edtk.calibration.calibration import Calibration
from edtk.calibration.cause_of import cause_of

# Numbers by joint, and other ones, that rest on the estimate: with wrong columns they mean nothing.
BY_JOINT = ("k", "std", "k_unbounded")
OTHERS = ("correlation", "covariance_dof", "rho0", "rho0_bias", "budget_mm", "expected_error")


def misread_sheet(found: Calibration) -> dict[str, Any] | None:
    """Name the causes of a sheet that was taken as it is, without the estimate.

    A person reads one line that says which columns look misread, and no result. A program asks for
    the causes and the verdict, and is not to read compliances that are known to be wrong.

    Args:
        found: The calibration of the sheet as it is.

    Returns:
        The keys of `Calibration.to_dict`, where all that rests on the estimate is null; None where
        no columns are misread.
    """
    if not any(cause_of(diagnostic.finding) for diagnostic in found.diagnostics):
        return None
    said = found.to_dict()
    joints = found.study.specification.joints.unknown
    empty = {name: dict.fromkeys(joints) for name in BY_JOINT}
    return {**said, **empty, **dict.fromkeys(OTHERS), "k_bias": None}

"""What edtk says of a filled-in sheet, and whether that is right."""

from dataclasses import dataclass
from pathlib import Path

from faults import Fault
from scene import Scene

import edtk
from edtk import Study
from edtk.calibration.calibrate import InputError
from edtk.findings.causes.family import Cause
from edtk.findings.causes.faults import cause_of

UNLIKELY = 0.01  # p-value of residuals that counts as seen
REFUSED = "refused"  # an input error that is none of the causes


@dataclass(frozen=True)
class Answer:
    """What is said of a sheet.

    Attributes:
        verdict: "good", "usable" or "bad".
        causes: Causes that are named, the likeliest first.
        outliers: Rows that are named as outliers, counted from 0.
        common: Whether repetitions agree among themselves better than with the model.
        unlikely: Whether noise alone leaves such residuals in less than one case of a hundred.
    """

    verdict: str
    causes: tuple[Cause, ...]
    outliers: tuple[int, ...] = ()
    common: bool = False
    unlikely: bool = True

    @classmethod
    def of(cls, study: Study, path: Path) -> "Answer":
        """Identify as a user does. A sheet that is refused by name of its fault is one named."""
        try:
            found = edtk.identify(study, path)
        except InputError as error:
            cause = cause_of(error.finding)
            return cls("bad", (cause or Cause(REFUSED, 0.0, "", None, 0.0),))
        except edtk.UserError:
            return cls("bad", ())
        test = found.lack_of_fit
        p = found.fit.p_value
        return cls(
            verdict=found.verdict,
            causes=found.causes,
            outliers=tuple(found.fit.outliers.tolist()),
            common=test is not None and test.seen,
            unlikely=p is not None and p < UNLIKELY,
        )


@dataclass(frozen=True)
class Judged:
    """An answer beside what is true.

    Attributes:
        detected: Whether the verdict is not "good".
        right: Whether what is said first is right.
        among: Whether what is said first or second is.
        wrong: Whether a cause is named first that is not right.
        joint: Whether the joint of the fault is named, and no other one is.
        unlikely: See `Answer`.
    """

    detected: bool
    right: bool
    among: bool
    wrong: bool
    joint: bool
    unlikely: bool


def judged(fault: Fault, scene: Scene, answer: Answer) -> Judged:
    """Compare an answer with the fault.

    Noise that repetitions share, and outliers, have tests and lines of their own: of these it is
    right to name no other cause. A pose of one row that is off is an outlier as well.
    """
    first = answer.causes[0] if answer.causes else None
    if fault.cause == "common":
        is_right = [first is None and answer.common]
    elif fault.cause == "outlier":
        is_right = [first is None and set(scene.rows) <= set(answer.outliers)]
    elif fault.cause == "pose":
        is_right = [one.cause == "pose" and one.rows == scene.rows for one in answer.causes]
        if first is None and len(scene.rows) == 1:
            is_right = [answer.outliers == scene.rows]
    else:
        is_right = [one.cause == fault.cause for one in answer.causes]
    right = is_right[:1] == [True]
    return Judged(
        detected=answer.verdict != "good",
        right=right,
        among=any(is_right),
        wrong=first is not None and not right,
        joint=right and first is not None and first.joint == scene.joint,
        unlikely=answer.unlikely,
    )

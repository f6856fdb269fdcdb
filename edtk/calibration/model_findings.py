"""What is said of errors of the model, and of those that a sheet cannot tell."""

from collections.abc import Iterator, Mapping
from typing import Any

from edtk.calibration.model_left import LeftInTasks
from edtk.findings.finding import Data, Finding, Severity, Wording

# Of a single normal error 5 % is beyond twice its size. Where chances are twice that, what the
# sheet leaves open is what the promise rests on.
OFTEN = 0.1
# Of the displacement. A compensation that takes away nine tenths is what an engineer expects;
# where less is due to the model, more measurements do not help.
LARGE = 0.1
SHARE = 0.01  # of the total error, from which a part of it is named


def model_findings(left: LeftInTasks, shares: Mapping[str, Any], counts: bool) -> Iterator[Finding]:
    """Name errors of the model: those that are found, and those that the sheet leaves possible.

    Args:
        left: What is left in the tasks.
        shares: The likeliest shares of the pieces that the model lacks [%].
        counts: Whether the sheet speaks for one.
    """
    if counts and left.model >= SHARE * left.total:
        yield _found(left, shares)
    if left.chance > OFTEN:
        yield _untold(left)


def _found(left: LeftInTasks, shares: Mapping[str, Any]) -> Finding:
    """What is missing; a note where it makes little of the total, or a good compensation bad."""
    large = 2 * left.model**2 > left.total**2 and left.total > LARGE * left.before
    severity = Severity.WARNING if large else Severity.NOTE
    data = {"model": left.model, "place": left.tasks.place, **shares}
    return Finding.of(severity, WORDING, "model_error", **data)


def _untold(left: LeftInTasks) -> Finding:
    """What these poses cannot tell."""
    data = {"chance": left.chance, "most": left.most, "total": left.total}
    return Finding.of(Severity.WARNING, WORDING, "model_untold", **data, place=left.tasks.place)


PARTS = {
    "across_percent": "springs across the joints of {:.2g} % of their own",
    "held_percent": "friction of {:.2g} % of the loads",
    "turn_percent": "stiffnesses that vary by {:.2g} % from pose to pose",
}


def _model_error(data: Data) -> str:
    """What was found."""
    parts = [words.format(data[name]) for name, words in PARTS.items() if data[name]]
    size = f"{1e3 * data['model']:.2g} mm {data['place']}"
    return (
        f"the residuals look as if the robot had {', '.join(parts)}, which its model lacks: the "
        f"expected error counts {size} for that"
    )


def _model_untold(data: Data) -> str:
    """What is assumed."""
    chance = f"{100 * data['chance']:.0f} %"
    return (
        "these poses and loads do not tell friction and springs that the model lacks; with usual "
        f"ones, {chance} of such days end more than {1e3 * 2 * data['total']:.2g} mm off "
        f"{data['place']}, twice the error expected, and up to {1e3 * data['most']:.2g} mm off; "
        "other poses, and loads of other sizes, would tell"
    )


WORDING: Wording = {"model_error": _model_error, "model_untold": _model_untold}

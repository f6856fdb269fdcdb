"""What is said of errors of the model, and of those that a sheet cannot tell."""

from collections.abc import Iterator, Mapping

from edtk.calibration.geometry.pieces_left import MOST, LeftInTasks, PiecesLeft
from edtk.calibration.propagation import Propagation
from edtk.findings.finding import Data, Finding, Severity, Wording
from edtk.findings.model_error import ModelErrorFound
from edtk.measure.expected_error import ErrorBudget
from edtk.measure.task import Tasks

TWICE = 2.0  # the promised error, beyond which it is not kept
# Of a single normal error 5 % is beyond twice its size. Where chances are twice that, what the
# sheet leaves open is what the promise rests on.
OFTEN = 0.1
# Of the displacement. A compensation that takes away nine tenths is what an engineer expects;
# where less is due to the model, more measurements do not help.
LARGE = 0.1
SHARE = 0.01  # of the total error, from which a part of it is named


def model_findings(
    propagation: Propagation, found: ModelErrorFound, budget: ErrorBudget, tasks: Tasks
) -> Iterator[Finding]:
    """Name errors of the model: those that are found, and those that the sheet leaves possible.

    Args:
        propagation: How errors move the compliances.
        found: What the sheet says of the model.
        budget: The errors in the test poses.
        tasks: These.
    """
    left = propagation.model
    if left is None:
        return
    sizes = (budget.model, budget.total, budget.uncompensated)
    if found.counts:
        yield from _found(sizes, tasks.place, found.to_dict())
    given = (tasks, propagation.joints)
    chance = left.chance_beyond(*given, TWICE * budget.total)
    if chance > OFTEN:
        yield _untold(chance, left.quantile(*given, MOST), budget.total, tasks.place)


def pieces_findings(pieces: PiecesLeft, left: LeftInTasks) -> Iterator[Finding]:
    """The same of a study with [parameters].

    Args:
        pieces: What the sheet says of the model.
        left: What it leaves in the tasks.
    """
    if pieces.counts:
        sizes = (left.model, left.total, left.before)
        yield from _found(sizes, left.place, pieces.shares)
    if left.chance > OFTEN:
        yield _untold(left.chance, left.most, left.total, left.place)


def _found(
    sizes: tuple[float, float, float], place: str, shares: Mapping[str, float]
) -> Iterator[Finding]:
    """What is missing, by what it makes, the total, and the error without compensation [m].

    Nothing is said of what makes hardly any of the total.
    """
    model, total, before = sizes
    if model < SHARE * total:
        return
    large = 2 * model**2 > total**2 and total > LARGE * before
    severity = Severity.WARNING if large else Severity.NOTE
    yield Finding.of(severity, WORDING, "model_error", model=model, place=place, **shares)


def _untold(chance: float, most: float, total: float, place: str) -> Finding:
    """What these poses cannot tell."""
    data = {"chance": chance, "most": most, "total": total, "place": place}
    return Finding.of(Severity.WARNING, WORDING, "model_untold", **data)


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

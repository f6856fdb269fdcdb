"""Picture of a relaxation: the equivalence theorem, or the weights alone."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.frame_problem import FrameProblem
from edtk.design.problem import Problem
from edtk.design.relaxation.normalised import is_normalised
from edtk.design.relaxation.relaxation import Relaxation
from edtk.report.draw.design_stems import design_stems
from edtk.report.draw.weight_bars import weight_bars
from edtk.report.palette import BLUE
from edtk.report.panels import panels
from edtk.report.plain import plain
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST = 5000  # candidates beyond which the largest sensitivity of neighbours is drawn


def relaxation(found: Relaxation, ax: Any = None, x: ArrayLike | str | None = None) -> Any:
    """Draw the sensitivities of all candidates, and a stem of its weight at each that has some.

    Sensitivities are in parts of the largest. By the equivalence theorem an optimal design has
    weight only where its sensitivity is one, the largest; where several multipliers prove the
    bound, the largest of theirs is drawn. A relaxation that does not hold its candidates, as within
    one over poses, has its weights as bars.

    Args:
        found: The relaxation.
        ax: Axes to draw into; a new figure where they are not given.
        x: What to draw over: a number for each candidate (n,), or the name of a column of the data
            frame that the candidates came from. Defaults to its only column of numbers, or else to
            the candidates' numbers from zero.

    Returns:
        The axes.

    Raises:
        ArgumentError: x is not such.
    """
    ax = panels(ax, 1, 1, (7.0, 3.6))[0, 0]
    if found.problem is None:
        names = [str(i) for i in found.support]
        weight_bars(found.weights[found.support], names, "candidate", ax)
    else:
        _sensitivities(found, found.problem, x, ax)
    ax.set_title(
        f"{plain(found.criterion.label)} = {found.value:.5g}, bound {found.bound:.5g} "
        f"({found.proved_bound.kind.value})",
        fontsize=10,
    )
    return ax


def _sensitivities(
    found: Relaxation, problem: Problem, x: ArrayLike | str | None, ax: "Axes"
) -> None:
    """The sensitivities over x, and the weights."""
    at, label = _places(problem, x)
    rows = found.sensitivities(problem)
    top = rows.max(axis=1, keepdims=True)
    # At unit trace a multiplier may have any multiple of the identity besides: the least is zero.
    low = rows.min(axis=1, keepdims=True) if is_normalised(found.criterion) else 0.0
    span = top - low
    relative = ((rows - low) / np.where(span > 0, span, 1.0)).max(axis=0)
    order = np.argsort(at, kind="stable")
    shown_at, shown = _thinned(at[order], relative[order])
    once = len(np.unique(at)) == len(at)  # a line through several values at one x would jump
    ax.plot(shown_at, shown, "-" if once else ".", color=BLUE, label="sensitivity / largest")
    support = found.support
    design_stems(at[support], found.weights[support], "weight", plain(label), ax)
    ax.set_ylim(min(0.0, float(relative.min())), 1.05)


def _places(problem: Problem, x: ArrayLike | str | None) -> tuple[Array, str]:
    """What the candidates are drawn over (n,), and its name."""
    numbers = np.arange(problem.n, dtype=float)
    if not isinstance(x, str) and x is not None:
        at = np.asarray(x, dtype=float)
        if at.shape != numbers.shape or not np.isfinite(at).all():
            raise ArgumentError(
                f"expected a number for each of {problem.n} candidates", argument="x"
            )
        return at, "x"
    if not isinstance(problem, FrameProblem):
        if x is not None:
            message = "the candidates do not come from a data frame; expected numbers"
            raise ArgumentError(message, argument="x", given=repr(x))
        return numbers, "candidate"
    columns = problem.frame.select_dtypes("number").columns
    if x is None:
        if len(columns) != 1:
            return numbers, "candidate"
        x = str(columns[0])
    if x not in columns:
        names = ", ".join(map(str, columns))
        message = f"expected a column of numbers of the frame: {names}"
        raise ArgumentError(message, argument="x", given=repr(x))
    return problem.frame[x].to_numpy(dtype=float), x


def _thinned(at: Array, shown: Array) -> tuple[Array, Array]:
    """The largest of neighbours, where there are more than a picture can show."""
    n = len(at)
    if n <= MOST:
        return at, shown
    starts = np.linspace(0, n, MOST, endpoint=False).astype(int)
    largest = np.maximum.reduceat(shown, starts)
    return at[starts], largest

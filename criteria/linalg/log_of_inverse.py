"""The logarithm of a sum of variances as a concave expression in cvxpy."""

from typing import TYPE_CHECKING

from criteria.linalg.typing import Array

if TYPE_CHECKING:
    import cvxpy as cp


def log_of_inverse(
    M: "cp.Expression", B: Array, unit: float
) -> tuple["cp.Expression", list["cp.Constraint"]]:
    """``-log(trace(B M^-1 B') / unit)`` as the log of the largest g with ``g^2 trace <= g unit``.

    Args:
        M: Symmetric (p, p) expression.
        B: Rows (r, p).
        unit: The unit of the trace.
    """
    import cvxpy as cp

    g = cp.Variable(nonneg=True)
    return cp.log(g), [cp.matrix_frac(g * (B.T * unit**-0.5), M) <= g]

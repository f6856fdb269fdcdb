"""Whether so few visits can be better than base and tool alone, given what the model leaves out."""

from dataclasses import replace

import numpy as np

from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.position_rows import PositionRows
from edtk.design.plan import Plan
from edtk.system.typing import Array

USUAL = 1.0  # mm and mrad: errors of a drawing that are larger are the exception
HIDDEN = 1e-9  # of a direction: a visit alone tells it


def poor_left_out(question: GeometryQuestion, plan: Plan) -> tuple[str, ...]:
    """A sentence where a pose left out will likely be worse than with base and tool alone.

    With whitened columns ``Q R`` and the rows Q_b of a visit, its error left out has the covariance
    ``(I - Q_b Q_b')^-1``; with base and tool alone it is that of the noise, beside the errors of
    the drawing that these do not take up. Both are averages over the visits of the plan, of
    positions. Where the drawing has to err by more than a millimetre and a milliradian in each
    parameter for the calibration to pay, it likely does not.

    Args:
        question: The question; its study says what the model leaves out (noise.discrepancy_mm).
        plan: The visits; those of one pose and load count as one.
    """
    table = question.study.specification.noise
    if table is None or not table.discrepancy_mm:
        return ()
    model = question.model
    errors = np.array([one.place in ("joint", "compliance") for one in model.parameters])
    if not errors.any():
        return ()
    # What repeats do not average out is most of such an error.
    noise = replace(question.setting.noise, model_white=table.discrepancy_mm)
    sigma = float(np.hypot(noise.reading, noise.model_white))
    rows = PositionRows(model, question.setting.loads)(plan.q, plan.wrench)
    rows = rows[:, model.placed_rows] / sigma
    both = _left_out(rows)
    alone = _left_out(rows[..., ~errors])
    moved = _not_taken(rows[..., errors], rows[..., ~errors])
    if both <= alone:
        return ()
    needed = np.sqrt((both - alone) / moved)
    if needed < USUAL:
        return ()
    off, placed = (sigma * np.sqrt(3 * size) for size in (both, alone))
    return (
        f"a pose that is not visited will be about {off:.2g} mm off, by what the model leaves out "
        f"(noise.discrepancy_mm = {table.discrepancy_mm:g}) and the noise; base and tool alone "
        f"leave {placed:.2g} mm besides the errors of the drawing. So few visits are better only "
        f"where these are above {needed:.2g} mm and mrad each: plan more visits, or ask for fewer "
        "parameters",
    )


def _left_out(rows: Array) -> float:
    """Mean square of a whitened coordinate (m, r) that is predicted without its visit."""
    m, r, p = rows.shape
    Q = np.linalg.qr(rows.reshape(m * r, p))[0].reshape(m, r, -1)
    hidden = np.eye(r) - Q @ np.swapaxes(Q, 1, 2)
    inverse = np.linalg.pinv(hidden, rcond=HIDDEN, hermitian=True)
    return float(np.einsum("mrr->", inverse)) / (m * r)


def _not_taken(moves: Array, taken: Array) -> float:
    """Mean square of a whitened coordinate by unit errors (m, r, e), less what others take up."""
    m, r, _ = moves.shape
    Q = np.linalg.qr(taken.reshape(m * r, -1))[0]
    C = moves.reshape(m * r, -1)
    return float(((C - Q @ (Q.T @ C)) ** 2).sum()) / (m * r)

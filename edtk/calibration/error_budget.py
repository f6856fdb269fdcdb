"""What is uncertain in a calibration, propagated to the error in the task."""

from collections.abc import Mapping

from edtk.calibration.propagation import Propagation
from edtk.calibration.uncertainty import Uncertainty
from edtk.inference.measurements import Measurements
from edtk.inference.prior_rows import PriorRows
from edtk.model.dead_weights import DeadWeights
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.error_budget import ErrorBudget
from edtk.model.tasks import Tasks
from edtk.system.typing import Array, Indices


def error_budget(
    model: ElastostaticModel,
    data: Measurements,
    tasks: Tasks,
    k: Array,
    covariance: Array,
    uncertainty: Uncertainty,
    model_error: float = 0.0,
    repeats: Indices | Array | None = None,
    known: Mapping[int, float] | None = None,
    prior: PriorRows | None = None,
    payload: DeadWeights | None = None,
) -> ErrorBudget:
    """Propagate what is uncertain in a calibration to the error in the task, to first order.

    A circumstance u changes the measurements by ``D u`` with ``D = d(A k)/du``, the estimate by
    ``A+ D u`` with the weighted least-squares inverse A+, and the tool point after compensation by
    ``A0 A+ D u``. A joint that counts as rigid, with compliance c, adds ``A_j c`` to the
    measurements and ``A0_j c`` to the task: its error is ``(A0_j - A0 A+ A_j) c``.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: Poses, loads, markers and noise of the calibration; measured values are not used.
        tasks: Where the robot shall be accurate.
        k: Compliances (p,), identified or assumed [rad/(N m)].
        covariance: Their covariance (p, p) by the noise.
        uncertainty: How well the circumstances are known.
        model_error: Error that the linear model leaves [m].
        repeats: Repetitions (m,) that each row stands for; one by default.
        known: Compliances of further joints, by their index [rad/(N m)].
        prior: What else is known of the compliances, where the estimate rests on that, too.
        payload: A payload beside the load, whose mass is as uncertain as the load's size.

    Raises:
        SingularPlanError: The poses do not identify all parameters.
    """
    found = Propagation.of(model, data, k, covariance, uncertainty, repeats, known, prior, payload)
    return found.budget(tasks, model_error)

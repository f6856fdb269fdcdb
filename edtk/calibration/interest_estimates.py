"""Estimates of the combinations of compliances that a study is about."""

import numpy as np

from edtk.inference.identification import Identification
from edtk.study.study import Study


def interest_estimates(
    asked: Study, fitted: Study, fit: Identification, combined: bool
) -> dict[str, tuple[float, float]]:
    """Find ``K'k`` and the roots of the diagonal of ``K' cov(k) K``.

    Args:
        asked: The study, which says what is of interest.
        fitted: The same, perhaps of fewer unknown joints: the others count as rigid.
        fit: The fit of these.
        combined: Whether some estimates are of combinations, which may be negative.

    Returns:
        Estimate and standard deviation of each combination, by its name; none where the study has
        no table `interest`.
    """
    if asked.interest is None:
        return {}
    joints = asked.specification.joints.unknown
    K = asked.interest[[joints.index(name) for name in fitted.specification.joints.unknown]]
    std = np.sqrt(np.einsum("ps,pq,qs->s", K, fit.covariance, K))
    k = fit.unbounded if combined else fit.k
    pairs = zip((k @ K).tolist(), std.tolist(), strict=True)
    return dict(zip(asked.interest_names, pairs, strict=True))

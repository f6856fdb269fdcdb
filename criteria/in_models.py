"""Criteria about one of several models that stand side by side."""

from collections.abc import Sequence

import numpy as np

from criteria.criterion import Criterion
from criteria.criterion_error import CriterionError
from criteria.interest import Interest
from criteria.relaxable import Relaxable


def in_models(parts: Sequence[Criterion], sizes: Sequence[int]) -> tuple[Relaxable, ...]:
    """Criteria of ``diag(M_1, .., M_k)``, each about the parameters of its own model alone.

    Of a block diagonal matrix, the information about the parameters of a block is that block.

    Args:
        parts: Criteria, one a model.
        sizes: Numbers of parameters of the models.

    Raises:
        CriterionError: There are not as many sizes as criteria, or one is not positive; or a
            criterion cannot be about a part of the parameters.
    """
    if len(sizes) != len(parts) or min(sizes) < 1:
        raise CriterionError(f"sizes: expected a positive number for each of {len(parts)} criteria")
    ends = np.cumsum(sizes)
    columns = np.eye(int(ends[-1]))
    blocks = [columns[:, end - size : end] for size, end in zip(sizes, ends, strict=True)]
    return tuple(_about(part, block) for part, block in zip(parts, blocks, strict=True))


def _about(part: Criterion, block: np.ndarray) -> Interest:
    """A criterion about the parameters that the columns of a block (p, s) choose."""
    if not isinstance(part, Interest):
        return Interest(part, block)
    if len(part.K) != block.shape[1]:
        raise CriterionError(
            f"criterion {part.label!r} is about {len(part.K)} parameters, and its model has "
            f"{block.shape[1]}"
        )
    return part.of(block @ part.K)

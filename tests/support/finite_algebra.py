"""A watch on linear algebra, whose libraries print words of their own about NaN and infinity."""

from typing import Any

import numpy as np
import pytest

TAKE_APART = ("svd", "eigh", "eigvalsh", "qr", "cholesky", "solve", "inv", "slogdet")


def require_finite(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no matrix be taken apart of which a number is not finite."""
    for name in TAKE_APART:
        whole = getattr(np.linalg, name)

        def watched(a: Any, *arguments: Any, whole: Any = whole, **options: Any) -> Any:
            assert np.isfinite(np.asarray(a)).all()
            return whole(a, *arguments, **options)

        monkeypatch.setattr(np.linalg, name, watched)

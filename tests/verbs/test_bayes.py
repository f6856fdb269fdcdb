"""What a caller says of the noise is within what a study may say."""

import pytest

import edtk
from edtk.fit.noise import Noise
from edtk.verbs.bayes import _noise


@pytest.mark.parametrize("nu", [1e308, 0.01, -1.0, float("nan")])
def test_wrong_degrees_of_freedom(nu: float) -> None:
    """Degrees of freedom beyond all sense are one line that names the argument."""
    with pytest.raises(edtk.UserError, match=r"^nu .*: expected a number from 0\.1 to 1e6"):
        _noise(Noise(), None, nu)


@pytest.mark.parametrize("factor", [0.5, 1e30, float("nan")])
def test_wrong_factors_of_sigma(factor: float) -> None:
    """So are factors."""
    with pytest.raises(edtk.UserError, match=r"^sigma_factor .*: expected a number from 1 to 1e6"):
        _noise(Noise(), factor, None)


def test_words_and_numbers() -> None:
    """Words, numbers and nothing at all mean what they say."""
    assert _noise(Noise(2.0, 5.0), None, None) == Noise(2.0, 5.0)
    assert _noise(Noise(), float("inf"), "sampled") == Noise(float("inf"), None)
    assert _noise(Noise(), None, 7) == Noise(1.0, 7)

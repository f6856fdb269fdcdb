"""Values of criteria as people read them."""

import pytest

import criteria
from criteria.criterion import printed, unit_of


@pytest.mark.parametrize(
    ("name", "units", "unit"),
    [
        ("A", ("rad/(N m)", "rad/(N m)"), "(rad/(N m))^2"),
        ("D", ("rad/(N m)",), "(N m/rad)^2"),
        ("O3", ("m/N",), "N/m"),
        ("O5", ("rad/(N m)",), "rad/(N m)"),
        ("O2", ("rad/(N m)",), ""),
        ("A", ("rad/(N m)", "m/N"), ""),
        ("rho0", ("rad/(N m)",), "mm"),
    ],
)
def test_a_criterion_has_the_unit_of_the_parameters_to_its_power(
    name: str, units: tuple[str, ...], unit: str
) -> None:
    """Units of parameters that are c times as large make the cost ``c**(2 degree)`` times so."""
    assert unit_of(criteria.get(name), units) == unit


def test_a_value_is_printed_with_the_unit_of_its_criterion() -> None:
    """A criterion with a unit of its own has it; another has the power of the parameters'."""
    assert printed(criteria.get("rho0"), 2.5e-6, digits=3) == "0.0025 mm"
    assert printed(criteria.get("D"), 4e14, ["rad/(N m)"]) == "4e+14 (N m/rad)^2"
    assert printed(criteria.get("O2"), 3.0, ["rad/(N m)"]) == "3"

"""What the benchmarks time can be run, on the smallest cases."""

import pytest


def test_relaxation(script):
    """Edtk and a direct model come to the same optimum."""
    benchmark = script("benchmarks/relax.py")
    _, cost, gap, *_ = benchmark.ours(("A",), 300, 1)["A"]
    assert gap < 1e-6
    assert benchmark.direct("A", 300, "CLARABEL")[1] == pytest.approx(cost, rel=1e-3)


def test_plans(script):
    """A plan that is good enough is found."""
    assert script("benchmarks/plan.py").ours(3, 0) > 0


def test_identification(script):
    """Measurements of markers are read and identified from."""
    reading, fitting = script("benchmarks/inference.py").identification(50, True, False)
    assert reading > 0
    assert fitting > 0

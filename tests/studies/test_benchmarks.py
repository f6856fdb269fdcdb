"""What the benchmarks time can be run, on the smallest cases."""

import pytest


def test_relaxation(script):
    """Edtk and a direct model come to the same optimum."""
    benchmark = script("benchmarks/relax.py")
    _, cost, gap, *_ = benchmark.ours(("A",), 300, 1)["A"]
    assert gap < 1e-6
    assert benchmark.direct("A", 300, "CLARABEL")[1] == pytest.approx(cost, rel=1e-3)


@pytest.mark.slow
def test_general(script):
    """Edtk and a direct model come to the same optimum of Gaussian rows; a pass has its seconds."""
    benchmark = script("benchmarks/general.py")
    case = benchmark.Case(5, 200, 1, "D")
    *_, gap, _, cost = benchmark.ours(case)
    assert gap < 1e-6
    assert benchmark.direct(case)[1] == pytest.approx(cost, rel=1e-3)
    p, _, gap, support = benchmark.geometry("D", 60)
    assert gap < 1e-6
    assert 0 < support <= 60
    assert p == 35


@pytest.mark.slow
def test_passes(script):
    """Ten criteria have a gap, and a pass takes a part of each."""
    one, found = script("benchmarks/general.py").passes(300)
    assert one > 0
    assert len(found) == 10
    assert all(gap < 1e-6 for _, gap in found.values())


def test_plans(script):
    """A plan that is good enough is found."""
    assert script("benchmarks/plan.py").ours(3, 0) > 0


def test_identification(script):
    """Measurements of markers are read and identified from."""
    reading, fitting = script("benchmarks/inference.py").identification(50, True, False)
    assert reading > 0
    assert fitting > 0


def test_exact_plans(script, monkeypatch):
    """A plan on candidates is as good as asked, and a start takes some time."""
    benchmark = script("benchmarks/exact.py")
    monkeypatch.setattr(benchmark, "STARTS", 8)
    best, seconds, found = benchmark.own(benchmark.CASES[0])
    assert best == pytest.approx(benchmark.CASES[0].best, abs=benchmark.SAME)
    assert seconds > 0
    assert found > 0


def test_exact_plans_of_poses(script):
    """A line has what a plan took and its share above the bound, or why there is none."""
    benchmark = script("benchmarks/exact_poses.py")
    made = benchmark.Measured((35, 31.2, 20.4, 0.00641, 2), 900.0)
    late = benchmark.Measured(None, 0.0, "> 60 s")
    report = benchmark._report([("D", 0), ("A", 0)], [made, late])
    lines = [[cell.strip() for cell in line.split("|")] for line in report.splitlines()]
    row = ["D", "0", "35", "31 s", "20 s", "0.64 %", "2", "900 MB"]
    assert row in [line[1:-1] for line in lines]
    assert [line[3] for line in lines if line[1:3] == ["A", "0"]] == ["> 60 s"]


@pytest.mark.slow
def test_relaxation_of_several_tasks(script, monkeypatch):
    """The study gets as many poses as it is asked for, and a line has a gap."""
    benchmark = script("benchmarks/tasks.py")
    monkeypatch.setattr(benchmark, "CANDIDATES", 60)
    study = benchmark.around(benchmark.edtk.load_study(benchmark.STUDY), 3)
    assert benchmark.row(study, "rho_max").startswith("| rho_max | 3 | ")

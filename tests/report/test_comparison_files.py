"""The files of a comparison."""

import pytest
from comparisons import PATH, other_criteria, two_sizes

from edtk.report.comparison_report import comparison_files
from edtk.study.plan_study import relax_study
from edtk.study.study import load_study


@pytest.mark.slow
def test_files(tmp_path):
    """Report and figures lie side by side; a size without a plan has no heat map."""
    relaxed = {"rho0": relax_study(load_study(PATH), "rho0", candidates=200)}
    files = comparison_files(other_criteria(tmp_path, relaxed))
    text = files.pop(tmp_path / "report.md")
    names = {"comparison.png", "efficiency_m3.png", "efficiency_m4.png"}
    assert set(files) == {tmp_path / name for name in names}
    assert all(content.startswith(b"\x89PNG") for content in files.values())
    assert all(f"({name})" in text for name in names)
    left = comparison_files(two_sizes(tmp_path, relaxed, "rho0"))  # one experiment has no plan
    assert {path.name for path in left} == {"comparison.png", "efficiency_m3.png", "report.md"}

"""The files of a comparison."""

from comparisons import PATH, other_criteria, two_sizes

from edtk.report.write_comparison import write_comparison
from edtk.study.relax_study import relax_study
from edtk.study.study import load_study


def test_files(tmp_path):
    """Report and figures lie side by side; heat maps of other sizes are removed."""
    relaxed = {"rho0": relax_study(load_study(PATH), "rho0", candidates=200)}
    (tmp_path / "efficiency_m7.png").write_bytes(b"old")
    write_comparison(other_criteria(tmp_path, relaxed))
    pictures = {path.name: path.read_bytes() for path in tmp_path.glob("*.png")}
    assert set(pictures) == {"comparison.png", "efficiency_m3.png", "efficiency_m4.png"}
    assert all(content.startswith(b"\x89PNG") for content in pictures.values())
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert all(f"({name})" in text for name in pictures)
    write_comparison(two_sizes(tmp_path, relaxed, "rho0"))
    left = {path.name for path in tmp_path.glob("*.png")}
    assert left == {"comparison.png", "efficiency_m3.png"}  # one experiment has no plan

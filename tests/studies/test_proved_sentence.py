"""README's sentence about every pose is no stronger than what the benchmark has proved."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_sentence_is_proved() -> None:
    """The number of README is at most the proved bound on the page, whose boxes were checked."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    said = re.search(r"is better than ([\d.]+) \(1e-3 mm\)/sqrt\(m\)", readme)
    page = (ROOT / "studies" / "benchmarks" / "proof.md").read_text(encoding="utf-8")
    proved = re.search(r"no plan of m experiments .* below ([\d.]+) \(1e-3 mm\)/sqrt\(m\)", page)
    assert said
    assert proved
    assert float(said[1]) <= float(proved[1])
    assert "checked by `edtk verify`: valid" in page

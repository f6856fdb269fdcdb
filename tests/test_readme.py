"""README says what is true: its example runs, its table is the registry, its commands exist."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np

import criteria

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
EXAMPLE, PLUGIN = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def test_example_prints_what_it_says() -> None:
    """The Python example runs as it stands, in at most twelve lines, and prints weights of one third."""
    assert len(EXAMPLE.strip().split("\n")) <= 12
    answer = subprocess.run(
        [sys.executable, "-W", "error", "-c", EXAMPLE], capture_output=True, text=True, check=True
    )
    lines = answer.stdout.strip().split("\n")
    assert [line.split("  ")[0] for line in lines[:3]] == ["x = -1.00", "x = +0.00", "x = +1.00"]
    assert all("weight 0.3333  4 of 12" in line for line in lines[:3])
    assert len(lines) == 4


def test_plugin_snippet_obeys_the_laws_it_declares() -> None:
    """The snippet's criterion has the gradient and the degree that it says."""
    space: dict[str, object] = {}
    exec(PLUGIN, space)
    criterion = space["TraceOfInformation"]()  # type: ignore[operator]
    M, dM = np.diag([1.0, 2.0, 5.0]), np.diag([1.0, -1.0, 0.5])
    slope = (criterion.cost(M + 1e-6 * dM) - criterion.cost(M - 1e-6 * dM)) / 2e-6
    assert np.isclose(slope, np.sum(criterion.gradient(M) * dM), rtol=1e-7)
    assert np.isclose(criterion.cost(2 * M), criterion.cost(M) / 2)
    assert criterion.value(M) == 8


def test_table_of_criteria_is_the_registry() -> None:
    """Every row of the table is a registered criterion with its title, formula, sense and convexity."""
    section = README[README.index("## Criteria") : README.index("### Adding")]
    rows = [
        [c.strip().strip("`") for c in line.split("|")[1:-1]]
        for line in section.split("\n")
        if line[:2] == "| "
    ]
    described = [criteria.get(name).describe() for name in criteria.available()]
    yes = {True: "yes", False: "no"}
    assert rows[1:] == [
        [d["name"], d["title"], d["formula"], d["sense"], yes[d["convex"]]] for d in described
    ]


def test_every_command_and_file_named_exists() -> None:
    """The commands in the table are those of the program, and linked files are there."""
    listed = set(re.findall(r"^\| `edtk (\w+)", README, flags=re.MULTILINE))
    helped = subprocess.run(
        [sys.executable, "-m", "edtk", "--help"], capture_output=True, text=True, check=True
    ).stdout
    assert listed == set(re.findall(r"^  (\w+)  ", helped, flags=re.MULTILINE))
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).is_file(), target
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    assert set(re.findall(r"^make (\w+)$", README, flags=re.MULTILINE)) <= targets

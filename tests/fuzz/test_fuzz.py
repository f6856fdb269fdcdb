"""The first cases of the fuzzer keep all promises; see README.md beside this file."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.case import Case
from tests.fuzz.judge import judge
from tests.fuzz.run_case import Answer
from tests.fuzz.sandbox import Sandbox

ROOT = Path(__file__).parents[2]
CASES = 100  # of those below `tests.fuzz.case.SHORT`; `make fuzz` runs 100,000


@pytest.mark.slow
def test_every_command_keeps_its_promises() -> None:
    """One line on failure, strict JSON on success, nothing left behind, and no traceback."""
    command = [sys.executable, "-m", "tests.fuzz", "--workers", "1", "--cases", str(CASES)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f"{CASES} cases" in ran.stdout


@pytest.mark.parametrize(
    ("stdout", "stderr", "signatures"),
    [
        (b"row,q1\n1,0\n", b"edtk: warning: task.csv: 1 row left out\n", []),
        (b"program\n", b"edtk: warning: a.src: line 3: is computed\n", []),
        (b"", b"edtk: warning: task.csv: 2 rows left out\n", ["nothing of an answer in part"]),
        (b"row,q1\n1,0\n", b"", ["nothing says what is left out"]),
    ],
)
def test_an_answer_in_part_has_a_part_and_says_what_it_lacks(
    stdout: bytes, stderr: bytes, signatures: list[str], tmp_path: Path
) -> None:
    """Exit code 1 of `edtk compensate` alone is no success."""
    words = ("compensate", "study.toml", "k.json", "task.csv")
    case = Case(0, "", "", words, {})
    answer = Answer(1, stdout, stderr, "", 0.0, 0.0)
    found = judge(case, answer, Sandbox(tmp_path, {}), {}, {})
    assert [one.signature.partition(":")[0] for one in found] == signatures

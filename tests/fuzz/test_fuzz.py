"""The first cases of the fuzzer keep all promises; see README.md beside this file."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
CASES = 100  # of those below `tests.fuzz.case.SHORT`; `make fuzz` runs 100,000


def test_every_command_keeps_its_promises() -> None:
    """One line on failure, strict JSON on success, nothing left behind, and no traceback."""
    command = [sys.executable, "-m", "tests.fuzz", "--workers", "1", "--cases", str(CASES)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f"{CASES} cases" in ran.stdout

"""The first cases of the fuzzer keep all promises; see README.md beside this file."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
CASES = 2000  # `tests.fuzz.case.SHORT`: later numbers take longer
CHUNK = 1000  # the program that runs a chunk takes three seconds to start


@pytest.mark.parametrize("first", range(0, CASES, CHUNK))
def test_every_command_keeps_its_promises(first: int) -> None:
    """One line on failure, strict JSON on success, nothing left behind, and no traceback."""
    command = [sys.executable, "-m", "tests.fuzz", "--workers", "1"]
    command += ["--first", str(first), "--cases", str(CHUNK)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f"{CHUNK} cases" in ran.stdout

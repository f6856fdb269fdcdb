"""The name of a problem's candidates: a hash of all their numbers."""

import hashlib

import numpy as np

from edtk.design.problem import Problem
from edtk.design.rows import Rows


def problem_digest(problem: Problem) -> str:
    """SHA-256 of a problem's candidates and prior information, in hexadecimal digits.

    It is that of a line of text, then of numbers as little-endian doubles. Of rows the line is
    "rows N R P", and the numbers are the rows ``A_i / sigma`` (N, R, P); of information it is
    "triangles Q N", and they are the packed triangles (Q, N). M0 (P, P) follows if there is one.
    """
    kept = problem.kept
    if isinstance(kept, Rows):
        words = ("rows", *kept.A.shape)
        numbers = kept.A
    else:
        words = ("triangles", *problem.packed.shape)
        numbers = problem.packed
    found = hashlib.sha256((" ".join(map(str, words)) + "\n").encode())
    for array in (numbers, problem.prior):
        if array is not None:
            found.update(np.ascontiguousarray(array, dtype="<f8").data)
    return found.hexdigest()

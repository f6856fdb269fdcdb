"""Numbers that a person writes, in the units of files: those that no slip of the pen makes."""

from typing import Annotated

from pydantic import Field

# A kilometre in millimetres, a hundred tonnes in newtons. Fourth powers of such numbers over the
# least sigma, and their products over all parameters, are still far from an overflow.
LARGEST = 1e6

Finite = Annotated[float, Field(allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Vector3 = tuple[Finite, Finite, Finite]
ZERO: Vector3 = (0.0, 0.0, 0.0)

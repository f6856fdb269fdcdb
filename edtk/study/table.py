"""The base of all tables of a study, and the kinds of numbers that stand in them."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Finite, Field(gt=0)]
Vector3 = tuple[Finite, Finite, Finite]
ZERO: Vector3 = (0.0, 0.0, 0.0)

# No instrument measures better than a picometre, and squares of smaller numbers underflow.
Sigma = Annotated[Finite, Field(ge=1e-9)]

# Compliances beyond these bounds [rad/(N m)] are slips of the pen, and their squares overflow.
Compliance = Annotated[Finite, Field(ge=1e-30, le=1e30)]


class Table(BaseModel):
    """A table of keys: unknown keys are rejected, and values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)

"""The base of all tables of a study, and the kinds of values that stand in them."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from edtk.system.fields import LARGEST, Finite

# Squares of smaller numbers underflow.
Positive = Annotated[Finite, Field(ge=1e-12)]

NotNegative = Annotated[Finite, Field(ge=0)]

# No instrument measures better than a picometre, and squares of smaller numbers underflow.
Sigma = Annotated[Finite, Field(ge=1e-9)]

# Compliances beyond these bounds [rad/(N m)] are slips of the pen.
Compliance = Annotated[Finite, Field(ge=1e-15, le=1e3)]

# Each one takes memory, and some of them time.
Count = Annotated[int, Field(ge=1, le=int(LARGEST))]


class Table(BaseModel):
    """A table of keys: unknown keys are rejected, and values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def listed(value: object) -> object:
    """A single name as a list of one."""
    return (value,) if isinstance(value, str) else value

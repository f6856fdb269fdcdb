"""A criterion with its parameters, as a study's key `criterion`."""

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from criteria.named_parameters import named_parameters


class CriterionTable(BaseModel):
    """The criterion that the study is about, with the parameters that it needs."""

    # Parameters are those of the criterion, which plug-ins extend; the criterion checks them.
    model_config = ConfigDict(extra="allow", frozen=True)

    name: str = Field(description="Name of the criterion, see `edtk criteria`")

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, given: Any) -> Any:
        """A name stands for a table that holds nothing else."""
        if isinstance(given, str):
            return {"name": given}
        if not isinstance(given, Mapping | CriterionTable):
            raise PydanticCustomError("criterion", "expected a name, or a table with a name")
        return given

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters as they are written."""
        return dict(self.model_extra or {})

    def build(self, unknown: Sequence[str]) -> dict[str, Any]:
        """The parameters as `criteria.create` takes them.

        Args:
            unknown: Names (p,) of the joints whose compliances are unknown.

        Raises:
            ValueError: A joint is not among them; the line names it.
        """
        return named_parameters(self.parameters, unknown, "unknown joint")

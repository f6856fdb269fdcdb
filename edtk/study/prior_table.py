"""The knowledge before the measurements, as the keys of a study's table `prior`."""

import math
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from edtk.study.table import Compliance, Table
from edtk.system.finite import LARGEST, Finite

if TYPE_CHECKING:
    from edtk.inference.noise import Noise
    from edtk.inference.prior import Marginal as MarginalDensity

LEAST_NU = 0.1  # below it nearly all errors would be outliers
# Numbers that each kind of marginal takes.
NUMBERS_OF_KIND = {
    "flat": frozenset[str](),
    "half-normal": frozenset({"scale_rad_per_Nm"}),
    "log-normal": frozenset({"median_rad_per_Nm", "factor"}),
}


class Marginal(Table):
    """Knowledge of one compliance before the measurements."""

    kind: Literal["flat", "half-normal", "log-normal"] = Field(
        description="Density: flat on all positive compliances, half-normal or log-normal"
    )
    scale_rad_per_Nm: Compliance | None = Field(
        None, description="Scale of a half-normal density [rad/(N m)]"
    )
    median_rad_per_Nm: Compliance | None = Field(
        None, description="Median of a log-normal density [rad/(N m)]"
    )
    factor: Annotated[Finite, Field(gt=1)] | None = Field(
        None, description="Factor to either side of the median that is one standard deviation [-]"
    )

    @model_validator(mode="after")
    def _its_numbers(self) -> "Marginal":
        numbers = ("scale_rad_per_Nm", "median_rad_per_Nm", "factor")
        given = {key for key in numbers if getattr(self, key) is not None}
        wanted = NUMBERS_OF_KIND[self.kind]
        if given != wanted:
            words = " and ".join(sorted(wanted, reverse=True)) or "no numbers"
            raise PydanticCustomError("prior", f"a {self.kind} prior has {words}")
        return self

    def build(self) -> "MarginalDensity":
        """The density [rad/(N m)]."""
        from edtk.inference import prior

        if self.scale_rad_per_Nm is not None:
            return prior.HalfNormal(self.scale_rad_per_Nm)
        if self.median_rad_per_Nm is not None and self.factor is not None:
            return prior.LogNormal(self.median_rad_per_Nm, self.factor)
        return prior.Flat()


class Earlier(Table):
    """Result of an earlier calibration."""

    mean_rad_per_Nm: dict[str, Finite] = Field(
        description="Estimated compliance of each unknown joint, by name [rad/(N m)]"
    )
    covariance: tuple[tuple[Finite, ...], ...] = Field(
        description="Their covariance, rows in the order of `joints.unknown` [(rad/(N m))^2]"
    )


class PriorTable(Table):
    """Knowledge of the compliances and of the noise before the measurements."""

    all: Marginal = Field(
        Marginal(kind="flat"), description="Density of every compliance that `joints` leaves out"
    )
    joints: dict[str, Marginal] = Field({}, description="Densities of single compliances, by joint")
    earlier: Earlier | None = Field(
        None, description="Result of an earlier calibration, multiplied with the densities"
    )
    earlier_file: str | None = Field(
        None, description="The same as a JSON file of `edtk identify`; instead of `earlier`"
    )
    in_design: bool = Field(
        False,
        description="Whether plans are designed, bounded and evaluated with this knowledge of the "
        "compliances beside the measurements",
    )
    sigma_factor: float = Field(
        1.0,
        description="Factor within which sigma is known: 1 exactly, inf not at all, else one "
        "standard deviation of its logarithm [-]",
    )
    nu: float | str = Field(
        "normal",
        description="Degrees of freedom of Student's t for the errors: 'normal' for infinitely "
        "many, 'sampled' to infer them, or a number from 0.1 to 1e6 [-]",
    )

    @field_validator("sigma_factor")
    @classmethod
    def _known_factor(cls, factor: float) -> float:
        if not (1 <= factor <= LARGEST or factor == math.inf):
            raise PydanticCustomError("factor", "expected a number from 1 to 1e6, or inf")
        return factor

    @model_validator(mode="after")
    def _one_calibration(self) -> "PriorTable":
        if self.earlier is not None and self.earlier_file is not None:
            raise PydanticCustomError("earlier", "expected one of earlier and earlier_file")
        return self

    @field_validator("nu", mode="plain")
    @classmethod
    def _known_nu(cls, nu: object) -> float | str:
        from edtk.inference.noise import NU_IN_WORDS

        if isinstance(nu, str) and nu in NU_IN_WORDS:
            return str(nu)
        if isinstance(nu, int | float) and not isinstance(nu, bool) and LEAST_NU <= nu <= LARGEST:
            return float(nu)
        raise PydanticCustomError("nu", "expected a number from 0.1 to 1e6, 'normal' or 'sampled'")

    def noise(self) -> "Noise":
        """The noise: sigma known to a factor, errors normal or of Student's t distribution."""
        from edtk.inference.noise import NU_IN_WORDS, Noise

        nu = NU_IN_WORDS[self.nu] if isinstance(self.nu, str) else self.nu
        return Noise(self.sigma_factor, nu)

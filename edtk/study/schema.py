"""The keys of a study file (TOML), validated, each table with what it builds."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from edtk.inference import noise, prior
from edtk.inference.noise import NU_IN_WORDS
from edtk.model.constraints.constraint import Constraint
from edtk.model.constraints.height import Height
from edtk.model.constraints.radius import Radius
from edtk.model.constraints.tilt import Tilt
from edtk.model.loads import load as model_load
from edtk.model.loads.bounded_load import BoundedLoad
from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.loads.free_load import FreeLoad
from edtk.model.loads.listed_load import ListedLoad
from edtk.model.transform import transform

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Finite, Field(gt=0)]
Sigma = Annotated[Finite, Field(ge=1e-9)]  # less is no measurement's, and squares underflow
Compliance = Annotated[Finite, Field(ge=1e-30, le=1e30)]
Vector3 = tuple[Finite, Finite, Finite]
ZERO: Vector3 = (0.0, 0.0, 0.0)


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Tool(_Table):
    """Tool frame after the last joint."""

    position_mm: Vector3
    rpy_deg: Vector3 = ZERO

    def build(self) -> Array:
        """Transform (4, 4) [m]."""
        return transform(np.array(self.position_mm) / 1e3, np.deg2rad(self.rpy_deg))


class Load(_Table):
    """Wrench at the tool point, in the world frame."""

    F_N: Vector3
    T_Nm: Vector3 = ZERO

    def build(self) -> Array:
        """Wrench (6,) [N, N m]."""
        return np.array([*self.F_N, *self.T_Nm])


class LoadChoice(_Table):
    """What a calibration experiment may apply: `F_N` always; `F_max_N` at most, in one direction or any; or a list."""

    F_N: Vector3 | None = None
    T_Nm: Vector3 = ZERO
    F_max_N: Positive | None = None
    direction: Vector3 | None = None
    list_F_N: Annotated[tuple[Vector3, ...], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _one_of_them(self) -> "LoadChoice":
        given = [key for key in ("F_N", "F_max_N", "list_F_N") if getattr(self, key) is not None]
        if len(given) != 1:
            raise PydanticCustomError("load", "expected one of F_N, F_max_N and list_F_N")
        if any(self.T_Nm) and self.F_N is None:
            raise PydanticCustomError("load", "T_Nm goes with F_N only")
        if self.direction is not None and (self.F_max_N is None or not any(self.direction)):
            raise PydanticCustomError("load", "direction goes with F_max_N, and is not zero")
        return self

    def build(self) -> model_load.Load:
        """The family of wrenches [N, N m]."""
        if self.F_N is not None:
            return FixedLoad(np.array([*self.F_N, *self.T_Nm]))
        if self.list_F_N is not None:
            return ListedLoad(np.array([[*F, 0, 0, 0] for F in self.list_F_N], dtype=float))
        assert self.F_max_N is not None
        if self.direction is None:
            return FreeLoad(self.F_max_N)
        unit = np.array(self.direction) / np.linalg.norm(self.direction)
        return BoundedLoad(np.append(self.F_max_N * unit, np.zeros(3)))

    def describe(self) -> str:
        """What a person reads."""
        if self.F_N is not None:
            return f"load F = ({', '.join(f'{f:g}' for f in self.F_N)}) N"
        if self.list_F_N is not None:
            return (
                "loads "
                + " or ".join(f"({', '.join(f'{f:g}' for f in F)})" for F in self.list_F_N)
                + " N"
            )
        if self.direction is None:
            return f"any force up to {self.F_max_N:g} N"
        return f"up to {self.F_max_N:g} N along ({', '.join(f'{d:g}' for d in self.direction)})"


class Measurement(_Table):
    """What is measured, and how well: sigma is that of a displacement, so of the difference of two positions."""

    rows: Literal["position", "pose"] = "position"
    sigma_mm: Sigma
    sigma_deg: Sigma | None = None


class Joints(_Table):
    """Which compliances are unknown, and which joints do not move."""

    unknown: Annotated[tuple[str, ...], Field(min_length=1)]
    fixed_deg: dict[str, Finite] = {}
    fixed_mm: dict[str, Finite] = {}


class WorkspaceTable(_Table):
    """Constraints on the calibration poses."""

    height_min_mm: Finite | None = None
    radius_min_mm: Positive | None = None
    tilt_max_deg: Annotated[Positive, Field(le=90)] | None = None
    plan_resolution_deg: Annotated[Finite, Field(ge=0)] = 0.0
    excluded: str | None = None
    excluded_within_deg: Positive = 5.0

    def build(self) -> tuple[Constraint, ...]:
        """The constraints that are given [m, rad]."""
        found: list[Constraint] = []
        if self.height_min_mm is not None:
            found.append(Height(self.height_min_mm / 1e3))
        if self.radius_min_mm is not None:
            found.append(Radius(self.radius_min_mm / 1e3))
        if self.tilt_max_deg is not None:
            found.append(Tilt(float(np.deg2rad(self.tilt_max_deg))))
        return tuple(found)


class TestPose(_Table):
    """The pose and load in which the robot shall be accurate; in `q_deg` a prismatic joint's entry is in mm."""

    __test__ = False  # not a test, whatever its name
    q_deg: tuple[Finite, ...]
    tool: Tool
    load: Load


class Simulation(_Table):
    """Assumed truth for simulated measurements."""

    compliance_rad_per_Nm: dict[str, Positive]


class Marginal(_Table):
    """What is known of one compliance before the measurements."""

    kind: Literal["flat", "half-normal", "log-normal"]
    scale_rad_per_Nm: Compliance | None = None
    median_rad_per_Nm: Compliance | None = None
    factor: Annotated[Finite, Field(gt=1)] | None = None

    @model_validator(mode="after")
    def _its_numbers(self) -> "Marginal":
        given = {
            key
            for key in ("scale_rad_per_Nm", "median_rad_per_Nm", "factor")
            if getattr(self, key) is not None
        }
        wanted = {
            "flat": set(),
            "half-normal": {"scale_rad_per_Nm"},
            "log-normal": {"median_rad_per_Nm", "factor"},
        }
        if given != wanted[self.kind]:
            numbers = " and ".join(sorted(wanted[self.kind], reverse=True)) or "no numbers"
            raise PydanticCustomError("prior", f"a {self.kind} prior has {numbers}")
        return self

    def build(self) -> prior.Marginal:
        """The density [rad/(N m)]."""
        if self.scale_rad_per_Nm is not None:
            return prior.HalfNormal(self.scale_rad_per_Nm)
        if self.median_rad_per_Nm is not None and self.factor is not None:
            return prior.LogNormal(self.median_rad_per_Nm, self.factor)
        return prior.Flat()


class Earlier(_Table):
    """Result of an earlier calibration: means by joint, covariance in the order of `joints.unknown`."""

    mean_rad_per_Nm: dict[str, Finite]
    covariance: tuple[tuple[Finite, ...], ...]


class PriorTable(_Table):
    """What is known of compliances, for all or by joint, and of the noise, before the measurements."""

    all: Marginal = Marginal(kind="flat")
    joints: dict[str, Marginal] = {}
    earlier: Earlier | None = None
    earlier_file: str | None = None
    sigma_factor: Annotated[float, Field(ge=1)] = 1.0
    nu: float | str = "normal"

    @model_validator(mode="after")
    def _one_calibration(self) -> "PriorTable":
        if self.earlier is not None and self.earlier_file is not None:
            raise PydanticCustomError("earlier", "expected one of earlier and earlier_file")
        return self

    @field_validator("nu", mode="plain")
    @classmethod
    def _known_nu(cls, nu: object) -> float | str:
        if isinstance(nu, str) and nu in NU_IN_WORDS:
            return str(nu)
        if isinstance(nu, int | float) and not isinstance(nu, bool) and 0 < nu < np.inf:
            return float(nu)
        raise PydanticCustomError("nu", "expected a number greater than 0, 'normal' or 'sampled'")

    def noise(self) -> noise.Noise:
        """The noise: sigma known to a factor (1 exactly, inf not at all), errors normal or Student-t."""
        nu = NU_IN_WORDS[self.nu] if isinstance(self.nu, str) else self.nu
        return noise.Noise(self.sigma_factor, nu)


class Specification(_Table):
    """The file's keys, as they are written."""

    title: str
    robot: str
    tool: Tool
    load: LoadChoice
    measurement: Measurement
    joints: Joints
    workspace: WorkspaceTable = WorkspaceTable()
    test_pose: TestPose | None = None
    criteria: Annotated[tuple[str, ...], Field(min_length=1)]
    optimise: Annotated[tuple[str, ...], Field(min_length=1)]
    sizes: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(min_length=1)]
    candidates: Annotated[int, Field(ge=1)] = 2000
    sampling: Literal["random", "sobol"] = "random"
    starts: Annotated[int, Field(ge=1)] = 64
    seed: Annotated[int, Field(ge=0)] = 0
    published: tuple[str, ...] = ()
    simulation: Simulation | None = None
    prior: PriorTable = PriorTable()

    @field_validator("criteria", "optimise", "sizes")
    @classmethod
    def _once_each(cls, given: tuple[object, ...]) -> tuple[object, ...]:
        if twice := [entry for entry in given if given.count(entry) > 1]:
            raise PydanticCustomError("twice", "{entry} is listed twice", {"entry": repr(twice[0])})
        return given

    @property
    def main(self) -> str:
        """The criterion that the study is about: rho0 where it is optimised, else the first that is."""
        return "rho0" if "rho0" in self.optimise else self.optimise[0]

    def descents(self, name: str) -> int:
        """How many, at most, a search for one plan makes: four times as many for the criterion that it is about."""
        return self.starts * (4 if name == self.main else 1)

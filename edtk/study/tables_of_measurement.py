"""Tables of a study about what is measured: instruments, noise, costs, and what is known."""

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from edtk.measure.noise import Tracker
from edtk.robots.joint import Joint
from edtk.system.fields import (
    LARGEST,
    ZERO,
    Compliance,
    Count,
    Finite,
    Line,
    NotNegative,
    Positive,
    Sigma,
    Table,
    Vector3,
)
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.fit.noise import Noise
    from edtk.fit.prior import Marginal as MarginalDensity

LEAST_REPEATABLE = 10  # [deg or mm]: no robot that is calibrated comes back worse
TOGETHER = ("tracker_position_mm", "along", "across")
LEAST_NU = 0.1  # below it nearly all errors would be outliers


class MeasurementTable(Table):
    """Measured quantities and their noise, which is that of a difference of two readings."""

    rows: Literal["position", "pose"] = Field(
        "position", description="Measured rows: the marker's position, or its rotation too"
    )
    sigma_mm: Sigma | None = Field(
        None,
        description="Standard deviation of a displacement or position, per coordinate; "
        "needed without a tracker in [noise], and added to it [mm]",
    )
    sigma_deg: Sigma | None = Field(
        None, description="Standard deviation of a rotation, per axis; for rows = 'pose' [deg]"
    )
    reference: Literal["unloaded", "nominal", "instrument"] = Field(
        "unloaded",
        description="What a displacement is measured from: the unloaded robot, which bends under "
        "the weight of its links too, or where the rigid robot of the model would be. With "
        "[parameters] readings are absolute (`instrument`) where the key is left out; with "
        "`unloaded` those under a load are read loaded minus unloaded",
    )


class MarkerTable(Table):
    """A marker; without any, the tool point is measured."""

    name: Line = Field(
        "", description="Name of the marker, as in sheets; defaults to `marker 1` and so on"
    )
    position_mm: Vector3 = Field(
        description="Offset from the tool point in the tool frame, or with `joint` in the frame of "
        "that joint [mm]"
    )
    joint: str | None = Field(
        None, description="The marker sits on the body that this joint moves; defaults to the tool"
    )
    rows: Literal["position", "pose"] | None = Field(
        None, description="What is measured of this marker; defaults to `measurement.rows`"
    )
    normal: Vector3 | None = Field(
        None,
        description="Where the marker's reflector looks, in the frame in which its position is "
        "given; without it it is seen from all sides [any length]",
    )
    normals: tuple[Vector3, ...] | None = Field(
        None,
        description="Mounts among which `edtk plan --place-tracker` chooses: where the reflector "
        "may look, in the frame of `normal` [any length]",
    )
    acceptance_deg: Annotated[Finite, Field(gt=0, le=180)] | None = Field(
        None,
        description="Largest angle between normal and beam at which it is read: 30 of a 1.5-inch "
        "reflector, the default, and 60 or so of a cat's eye [deg]",
    )

    @field_validator("normal")
    @classmethod
    def _some_normal(cls, given: Vector3 | None) -> Vector3 | None:
        if given is not None and not any(given):
            raise PydanticCustomError("normal", "expected a direction, got zeros")
        return given

    @model_validator(mode="after")
    def _some_normals(self) -> "MarkerTable":
        if self.normals is None:
            return self
        if self.normal is None:
            raise PydanticCustomError(
                "normal", "expected normal too, as normals are given: where the marker looks today"
            )
        if not self.normals or not all(map(any, self.normals)):
            raise PydanticCustomError("normals", "normals: expected directions, got none or zeros")
        return self


class DistanceTable(Table):
    """A distance that is measured from a fixed point: by a draw wire, a ballbar, an interferometer.

    The other end is the point of a marker, or has a place of its own.
    """

    name: Line = Field("", description="Name, as in sheets; defaults to `distance 1` and so on")
    anchor_mm: Vector3 = Field(description="The fixed point, in the world frame [mm]")
    marker: str | None = Field(
        None, description="Name of the marker at whose point the distance ends"
    )
    position_mm: Vector3 = Field(
        ZERO, description="The point where the distance ends, given as that of a marker [mm]"
    )
    joint: str | None = Field(
        None, description="The point sits on the body that this joint moves; defaults to the tool"
    )
    sigma_mm: Sigma | None = Field(
        None,
        description="Standard deviation of a change of this distance, or with [parameters] of one "
        "reading; defaults to `measurement.sigma_mm` [mm]",
    )

    @model_validator(mode="after")
    def _one_place(self) -> "DistanceTable":
        if self.marker is not None and {"position_mm", "joint"} & self.model_fields_set:
            raise PydanticCustomError("place", "expected marker, or a position_mm of its own")
        return self


# Poses nearer than this share what the model leaves out [deg]. Where it is of springs, which give
# way otherwise in another position, it varies once in a turn of a joint, and cos 60 deg is a half.
NEAR, OF_SPRINGS = 5.0, 60.0

# Within limits +-MPE, of which nothing else is known, errors are uniform: JCGM 100:2008, 4.3.7.
MPE_OVER_SIGMA = math.sqrt(3)

# Trackers with more than a millimetre, or a millimetre a metre, are not sold.
Coefficient = Annotated[Finite, Field(ge=0, le=1e3)]
Coefficients = tuple[Coefficient, Coefficient]


class NoiseTable(Table):
    """Errors that are not white: of a tracker, of joints that repeat, and of the model itself.

    A displacement is the difference of two readings, in each of which tracker and joints err anew;
    a position is one reading.
    """

    tracker_position_mm: Vector3 | None = Field(
        None,
        description="Where the tracker stands, in the world frame, which is that of the robot's "
        "file; a sheet of positions may have any frame, as the fit tells where the robot is [mm]",
    )
    tracker_places_mm: tuple[Vector3, ...] | None = Field(
        None,
        description="Places among which `edtk plan --place-tracker` chooses, in the world frame "
        "[mm]",
    )
    tracker_box_mm: tuple[Vector3, Vector3] | None = Field(
        None,
        description="Lower and upper corner of a box in which it searches for a place, in the "
        "world frame [mm]",
    )
    along: Coefficients | None = Field(
        None,
        description="Error a + b r of one reading along a beam of length r, as [a, b] [um, um/m]",
    )
    across: Coefficients | None = Field(
        None, description="The same for each direction across the beam [um, um/m]"
    )
    given_as: Literal["mpe", "sigma"] = Field(
        "mpe",
        description="What along and across are: largest permissible errors of a data sheet, whose "
        "standard deviation is MPE/sqrt(3), or standard deviations",
    )
    repeatability_deg: tuple[Finite, ...] = Field(
        (0.0,),
        description="Standard deviation with which a joint comes back, one for all or one per "
        "joint [deg; mm for a prismatic joint]",
    )
    discrepancy_mm: NotNegative = Field(
        0.0,
        description="Standard deviation of what the model leaves out of a displacement, per "
        "marker and coordinate; repeats do not average it out [mm]",
    )
    model_error_percent: Annotated[Finite, Field(ge=0, le=100)] | None = Field(
        None,
        description="What the model leaves out of the springs' displacement, as a share of it, "
        "half of the variance in the springs' turns and half in any direction; plans count it: "
        "repeats do not average it out, and tasks have it too. Springs are as [simulation] or "
        "[prior] guesses; a sheet tells itself what they leave out, but for 0. Where nothing is "
        "said of the model's errors the expected error of a plan assumes 10, and its poses 0 [%]",
    )
    discrepancy_within_deg: Positive | None = Field(
        None,
        description="Poses nearer than this share what the model leaves out, Euclidean over the "
        "revolute joints; 5, or 60 with model_error_percent alone: what varies once in a turn of a "
        "joint is correlated by a half over so much [deg]",
    )

    estimated: tuple[Literal["joints", "discrepancy"], ...] = Field(
        (),
        description="What a sheet of displacements tells itself, where its visits and markers do: "
        "`joints` for how well they come back, `discrepancy`; stated sizes then count in plans "
        "alone. Sheets of positions tell both anyway",
    )

    @field_validator("repeatability_deg", mode="before")
    @classmethod
    def _each_joint(cls, given: object) -> tuple[float, ...]:
        """One number or a list: a union of types would have errors that nobody reads."""
        numbers = given if isinstance(given, list | tuple) else (given,)
        sound = all(
            isinstance(x, int | float) and not isinstance(x, bool) and 0 <= x <= LEAST_REPEATABLE
            for x in numbers
        )
        if not sound or not numbers:
            raise PydanticCustomError(
                "repeatability",
                "expected a number from 0 to {most}, or a list of them, one per joint",
                {"most": LEAST_REPEATABLE},
            )
        return tuple(numbers)

    @model_validator(mode="after")
    def _whole_tracker(self) -> "NoiseTable":
        given = [key for key in TOGETHER if getattr(self, key) is not None]
        if given and len(given) < len(TOGETHER):
            missing = " and ".join(key for key in TOGETHER if key not in given)
            raise PydanticCustomError(
                "tracker", "expected {missing} too, as a tracker is given", {"missing": missing}
            )
        return self

    @model_validator(mode="after")
    def _some_places(self) -> "NoiseTable":
        if self.tracker_places_mm is not None and not self.tracker_places_mm:
            raise PydanticCustomError(
                "places", "tracker_places_mm is empty; expected one place [x, y, z] at least"
            )
        box = self.tracker_box_mm
        if box is not None and any(low > high for low, high in zip(*box, strict=True)):
            raise PydanticCustomError(
                "box", "tracker_box_mm: expected its lower corner first, then its upper one"
            )
        movable = box is not None or self.tracker_places_mm is not None
        if movable and not self.has_tracker:
            missing = " and ".join(TOGETHER)
            raise PydanticCustomError(
                "tracker",
                "expected {missing} too, as places of a tracker are given",
                {"missing": missing},
            )
        return self

    @property
    def has_tracker(self) -> bool:
        """Whether a tracker is given."""
        return self.tracker_position_mm is not None

    @property
    def is_white(self) -> bool:
        """Whether the table adds nothing to white noise."""
        return not (self.has_tracker or np.any(self.repeatability_deg) or self.errs)

    @property
    def errs(self) -> bool:
        """Whether the model leaves something out."""
        return bool(self.discrepancy_mm or self.model_error_percent)

    @property
    def within(self) -> float:
        """How far poses are apart that do not share what the model leaves out [deg].

        A discrepancy beside errors of springs keeps to its own distance, as a sheet, which tells
        itself what the springs do, has that alone.
        """
        if self.discrepancy_within_deg is not None:
            return self.discrepancy_within_deg
        return OF_SPRINGS if self.model_error_percent and not self.discrepancy_mm else NEAR

    @property
    def says_of_model(self) -> bool:
        """Whether it is said how much the model leaves out, be it nothing."""
        return self.model_error_percent is not None or self.discrepancy_mm > 0

    def tracker(self) -> Tracker | None:
        """The tracker [m]; None without one."""
        if self.tracker_position_mm is None or self.along is None or self.across is None:
            return None
        divisor = MPE_OVER_SIGMA if self.given_as == "mpe" else 1.0
        along, across = (
            (1e-6 * a / divisor, 1e-6 * b / divisor) for a, b in (self.along, self.across)
        )
        return Tracker(np.array(self.tracker_position_mm) / 1e3, along, across)

    def reading(self, factors: Array) -> dict[str, Any]:
        """What a reading errs by besides white noise, as a `VisitNoise` takes it.

        Args:
            factors: Units (n,) of the numbers of joints in a file [rad/deg or m/mm].
        """
        return {"tracker": self.tracker(), "repeatability": self.repeatability(factors)}

    def repeatability(self, factors: Array) -> Array:
        """Standard deviations (n,) of the joints [rad or m].

        Args:
            factors: Units (n,) of the numbers in a file [rad/deg or m/mm].
        """
        return np.array(self.repeatability_deg) * factors

    def describe(self) -> str:
        """The errors in words, for reports; empty if there are none."""
        parts = []
        if self.along is not None and self.across is not None:
            kind = "MPE" if self.given_as == "mpe" else "sigma"
            place = ", ".join(f"{x:g}" for x in self.tracker_position_mm or ())
            parts.append(
                f"tracker at ({place}) mm with {kind} {_sum(self.along)} along and "
                f"{_sum(self.across)} across its beam"
            )
        joints = np.unique(self.repeatability_deg)
        if joints.any():
            span = f"{joints[0]:g}" + (f" to {joints[-1]:g}" if len(joints) > 1 else "")
            parts.append(f"joints repeat within {span} deg")
        sizes = []
        if self.discrepancy_mm:
            sizes.append(f"discrepancy {self.discrepancy_mm:g} mm")
        if self.model_error_percent:
            sizes.append(f"model error {self.model_error_percent:g} % of the displacement")
        if sizes:
            shared = f"shared by poses within {self.within:g} deg"
            parts.append(f"{' and '.join(sizes)}, {shared}")
        return ", ".join(parts)


def _sum(coefficients: Coefficients) -> str:
    """``a + b r`` in words."""
    a, b = coefficients
    return f"{a:g} um + {b:g} um/m"


class UncertaintyTable(Table):
    """Standard deviations of what a calibration takes as given, besides the noise."""

    load_percent: NotNegative = Field(1.0, description="Size of the calibration load [%]")
    load_direction_deg: Annotated[Finite, Field(ge=0, le=90)] = Field(
        1.0, description="Direction of the calibration load, about each axis across it [deg]"
    )
    tool_mm: NotNegative = Field(
        1.0, description="Calibration tool point and marker, along each axis [mm]"
    )
    drift_mm: NotNegative = Field(
        0.0, description="Shift between unloaded and loaded readings that all share, per axis [mm]"
    )
    repeatability_mm: NotNegative = Field(
        0.0, description="Motion of the robot between the two readings of one visit, per axis [mm]"
    )
    rigid_rad_per_Nm: dict[str, Compliance] = Field(
        {},
        description="Compliance that a joint may have which counts as rigid, by joint; defaults to "
        "the median of the other joints' [rad/(N m)]",
    )


# One speed for all joints of a kind, or one for each of some.
Speed = Positive | dict[str, Positive]
SPEED_DEG, SPEED_MM = 30.0, 100.0  # a second: arms beside which people stand
# What of `[costs]` is about the clock, and changes no budget.
TIMES = frozenset(
    {
        "speed_deg_per_s",
        "speed_mm_per_s",
        "dwell_s",
        "warm_up_s",
        "load_change_s",
        "spread_percent",
    }
)


class CostsTable(Table):
    """Costs of visits and of load changes, in any unit, such as minutes; and the time they take.

    A plan costs ``visits * visit + load changes * load_change``. One that visits poses under one
    load alone, or under none, needs no change; one with several loads visits all poses of a load,
    then those of the next one. An experiment that measures a displacement from the unloaded pose
    costs both visits, and a day of them begins without a load.
    """

    visit: Positive = Field(1.0, description="Cost of a visit of a pose without a load [any unit]")
    loaded_visit: Positive | None = Field(
        None, description="Cost of a visit of a pose under a load; defaults to `visit` [any unit]"
    )
    load_change: Annotated[Finite, Field(ge=0)] = Field(
        0.0, description="Cost of mounting or changing a load in the course of the day [any unit]"
    )
    load_changes: Count | None = Field(
        None,
        description="Load changes of a plan with several loads, where drift asks for more than the "
        "least number; defaults to one fewer than the loads it visits",
    )
    budget: Positive | None = Field(
        None, description="What a plan may cost; decides its size where none is given [any unit]"
    )
    unit: Line = Field("", description='What the costs are counted in, for reports, such as "min"')
    speed_deg_per_s: Speed = Field(
        SPEED_DEG,
        description="Speed of joints that turn, one for all or by joint, others 30 [deg/s]",
    )
    speed_mm_per_s: Speed = Field(
        SPEED_MM,
        description="Speed of joints that slide, one for all or by joint, others 100 [mm/s]",
    )
    dwell_s: NotNegative = Field(
        0.0, description="Time that the arm stands in a visit, to come to rest and be measured [s]"
    )
    warm_up_s: NotNegative = Field(0.0, description="Time before the first visit [s]")
    load_change_s: NotNegative = Field(0.0, description="Time of a load change [s]")
    spread_percent: NotNegative = Field(
        10.0,
        description="By how much the visits of a load may take longer so that repetitions of a "
        "pose are spread over them, against drift [%]",
    )

    def speed_of(self, joint: Joint) -> float:
        """Speed of a joint [rad/s or m/s]."""
        turns = joint.kind == "revolute"
        given = self.speed_deg_per_s if turns else self.speed_mm_per_s
        if isinstance(given, dict):
            given = given.get(joint.name, SPEED_DEG if turns else SPEED_MM)
        return given * (np.pi / 180 if turns else 1e-3)

    @property
    def is_timed(self) -> bool:
        """Whether something is said of the time that a day takes."""
        return bool(self.model_fields_set & TIMES)

    @property
    def is_priced(self) -> bool:
        """Whether visits have costs: where only times are given, none is counted."""
        return not self.is_timed or bool(self.model_fields_set - TIMES - {"load_changes"})


# Numbers that each kind of marginal takes.
NUMBERS_OF_KIND = {
    "flat": frozenset[str](),
    "half-normal": frozenset({"scale_rad_per_Nm"}),
    "log-normal": frozenset({"median_rad_per_Nm", "factor"}),
    "normal": frozenset({"mean_rad_per_Nm", "std_rad_per_Nm"}),
}


class Marginal(Table):
    """Knowledge of one compliance before the measurements."""

    kind: Literal["flat", "half-normal", "log-normal", "normal"] = Field(
        description="Density: flat on all positive compliances, half-normal, log-normal or normal"
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
    mean_rad_per_Nm: Compliance | None = Field(
        None, description="Mean of a normal density [rad/(N m)]"
    )
    std_rad_per_Nm: Compliance | None = Field(
        None, description="Its standard deviation [rad/(N m)]"
    )

    @model_validator(mode="after")
    def _its_numbers(self) -> "Marginal":
        numbers = [key for key in type(self).model_fields if key != "kind"]
        given = {key for key in numbers if getattr(self, key) is not None}
        wanted = NUMBERS_OF_KIND[self.kind]
        if given != wanted:
            words = " and ".join(sorted(wanted, reverse=True)) or "no numbers"
            raise PydanticCustomError("prior", f"a {self.kind} prior has {words}")
        return self

    def build(self) -> "MarginalDensity":
        """The density [rad/(N m)]."""
        from edtk.fit import prior

        if self.scale_rad_per_Nm is not None:
            return prior.HalfNormal(self.scale_rad_per_Nm)
        if self.median_rad_per_Nm is not None and self.factor is not None:
            return prior.LogNormal(self.median_rad_per_Nm, self.factor)
        if self.mean_rad_per_Nm is not None and self.std_rad_per_Nm is not None:
            return prior.Gaussian(self.mean_rad_per_Nm, self.std_rad_per_Nm)
        return prior.Flat()


# No length of a drawing is known to a nanometre, and none errs by a kilometre.
Spread = Annotated[Finite, Field(ge=1e-6, le=1e6)]


class ErrorOfDrawing(Table):
    """How far lengths and angles may be from the drawing: normal, with these numbers.

    Of a tolerance +-t, of which nothing else is known, the standard deviation is t/sqrt(3).
    """

    std_mm: Spread | None = Field(
        None, description="Standard deviation of the lengths that are meant [mm]"
    )
    std_mrad: Spread | None = Field(
        None, description="Standard deviation of the angles that are meant [mrad]"
    )
    mean_mm: Finite = Field(0.0, description="How much longer than drawn these are [mm]")
    mean_mrad: Finite = Field(0.0, description="How far they are turned from the drawing [mrad]")

    @model_validator(mode="after")
    def _some_std(self) -> "ErrorOfDrawing":
        for std, mean in (("std_mm", "mean_mm"), ("std_mrad", "mean_mrad")):
            if getattr(self, std) is None and mean in self.model_fields_set:
                raise PydanticCustomError("drawing", f"{mean} goes with {std}; expected both")
        if self.std_mm is None and self.std_mrad is None:
            raise PydanticCustomError("drawing", "expected std_mm, std_mrad or both")
        return self

    def build(self, turns: bool) -> "MarginalDensity":
        """The density of an angle [rad], or of a length [m]; flat where nothing is said of it."""
        from edtk.fit import prior

        std, mean = (self.std_mrad, self.mean_mrad) if turns else (self.std_mm, self.mean_mm)
        return prior.Flat() if std is None else prior.Gaussian(mean / 1e3, std / 1e3)


class Earlier(Table):
    """Result of an earlier calibration."""

    mean_rad_per_Nm: dict[str, Finite] = Field(
        description="Estimated compliance of each unknown joint, by name [rad/(N m)]"
    )
    covariance: tuple[tuple[Finite, ...], ...] = Field(
        description="Their covariance, rows in the order of `joints.unknown` [(rad/(N m))^2]"
    )


class PriorTable(Table):
    """Knowledge of the parameters and of the noise before the measurements."""

    all: Marginal = Field(
        Marginal(kind="flat"), description="Density of every compliance that `joints` leaves out"
    )
    joints: dict[str, Marginal] = Field({}, description="Densities of single compliances, by joint")
    parameters: dict[str, ErrorOfDrawing] = Field(
        {},
        description="How far the geometry of a study with [parameters] may be from the drawing, by "
        "name (`q2.rz`), joint (`q2`), kind (`zeros`, `lengths`, `tilts`), `geometry` or `tool`; "
        "the entry that means fewest counts",
    )
    earlier: Earlier | None = Field(
        None, description="Result of an earlier calibration, multiplied with the densities"
    )
    earlier_file: str | None = Field(
        None,
        description="The same as a JSON file of `edtk identify`, of geometry too; instead of "
        "`earlier`",
    )
    in_design: bool = Field(
        False,
        description="Whether plans are designed, bounded and evaluated with this knowledge of the "
        "parameters beside the measurements",
    )
    sigma_factor: float = Field(
        1.0,
        strict=True,
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
        from edtk.fit.noise import NU_IN_WORDS

        if isinstance(nu, str) and nu in NU_IN_WORDS:
            return str(nu)
        if isinstance(nu, int | float) and not isinstance(nu, bool) and LEAST_NU <= nu <= LARGEST:
            return float(nu)
        raise PydanticCustomError("nu", "expected a number from 0.1 to 1e6, 'normal' or 'sampled'")

    def noise(self) -> "Noise":
        """The noise: sigma known to a factor, errors normal or of Student's t distribution."""
        from edtk.fit.noise import NU_IN_WORDS, Noise

        nu = NU_IN_WORDS[self.nu] if isinstance(self.nu, str) else self.nu
        return Noise(self.sigma_factor, nu)


class SimulationTable(Table):
    """The truth that simulated measurements assume."""

    compliance_rad_per_Nm: dict[str, Compliance] = Field(
        description="Compliance of each unknown joint, by name [rad/(N m)]"
    )

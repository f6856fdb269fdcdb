"""One thing that is wrong, or looks wrong, in measurements: as data, without words."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Any


class Kind(Enum):
    """The kinds of findings; `wording` has a sentence for each."""

    # Units.
    FORCE_UNIT = auto()
    OTHER_LOAD = auto()
    LENGTH_UNIT = auto()
    ROTATION_UNIT = auto()
    ANGLE_UNIT = auto()
    # Signs and sizes of compliances.
    ALL_NEGATIVE = auto()
    FAR_BELOW_ZERO = auto()
    NEAR_ZERO = auto()
    # Noise.
    NO_RESIDUALS = auto()
    NOISE_ABOVE_SIGMA = auto()
    NOISE_BELOW_SIGMA = auto()
    NOISE_ESTIMATED_LARGE = auto()
    NOISE_ESTIMATED_SMALL = auto()
    OUTLIERS = auto()
    TOO_FEW_FOR_ROBUST = auto()
    # Prior knowledge.
    RESTS_ON_PRIOR = auto()
    PRIOR_CONTRADICTED = auto()
    POSTERIOR_DIFFERS = auto()
    # Structure of the measured poses.
    EQUAL_ROWS = auto()
    ALIKE_PARAMETERS = auto()
    ONE_POSE = auto()
    LINEAR_MODEL = auto()
    LACK_OF_FIT = auto()
    MOVING_JOINTS = auto()
    REPEATABILITY = auto()
    CAUSE = auto()
    NO_CAUSE = auto()
    DO_NOT_COMPENSATE = auto()
    GAINS_LITTLE = auto()
    BEYOND_LIMITS = auto()
    NOT_MEASURED = auto()
    # Input errors, with which no result is given.
    OTHER_POSE = auto()
    COPIED_ROWS = auto()
    # Readings of the columns: input errors where one explains measurements that do not fit.
    AS_GIVEN = auto()
    WRONG_SIGN = auto()
    SWAPPED_COLUMNS = auto()
    OPPOSITE_SIGN = auto()
    JOINT_OFFSET = auto()
    MARKER_UNIT = auto()
    SWAPPED_MARKERS = auto()
    OTHER_AXES = auto()
    SEVERAL_READINGS = auto()


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or looks wrong.

    Attributes:
        kind: Its kind.
        rows: Rows of the file or of the plan, counted from 0.
        columns: Columns of the file.
        parameters: Names of the parameters.
        data: Numbers, units and circumstances by name, as `wording` reads them.
    """

    kind: Kind
    rows: tuple[int, ...] = ()
    columns: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)

"""Identified geometry and springs, with everything that a person wants to know about them."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.calibration import VERDICTS
from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.geometry.counting import Counting
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt
from edtk.calibration.geometry.geometry_to_dict import geometry_to_dict
from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.calibration.geometry.study_marks import study_marks
from edtk.calibration.origin import Origin
from edtk.inference.geometry.geometric_fit import GeometricFit, root_mean_square
from edtk.inference.geometry.geometry_density import GeometryDensity
from edtk.inference.geometry.geometry_posterior import GeometryPosterior, geometry_posterior
from edtk.inference.sample_posterior import SamplingOptions
from edtk.model.geometry.geometric_parameter import COMPONENTS
from edtk.model.geometry.rotation import rotation
from edtk.study.study import Study
from edtk.system.presented import Presented
from edtk.system.typing import Array
from edtk.tables.in_file_units import of_file_units

if TYPE_CHECKING:
    import pandas as pd

MM = 1e3


@dataclass(frozen=True, eq=False)
class GeometricCalibration(Presented):
    """Geometry, base, tools and springs that a sheet of positions tells, and whether to trust them.

    Attributes:
        setting: The study and its markers.
        fit: The fit, and how well it predicts poses that it did not see.
        doubts: Everything that looks wrong, the worst first.
        path: Where the positions are.
        counting: How the sheet counts the joints.
        left_out: Visits that were not fitted, as their positions are of no use.
        robust: Whether poses that fit badly count less.
        origin: The file as it was read, and what was asked for.
        posterior: What is known of the parameters by the nonlinear model; None where nobody asked.
    """

    setting: StudyGeometry
    fit: GeometricFit
    doubts: tuple[GeometricDoubt, ...]
    path: Path
    counting: Counting
    left_out: tuple[int, ...] = ()
    robust: bool = False
    origin: Origin = field(default_factory=Origin)
    posterior: GeometryPosterior | None = None

    @property
    def base(self) -> Array:
        """Where the drawing's world is in the instrument's frame, as fitted (4, 4) [m].

        The errors of the base are shifts along, and turns about, the axes of its start.
        """
        model = self.fit.fitted.model
        errors = np.zeros(6)
        for one in model.parameters:
            if one.place == "base":
                errors[COMPONENTS.index(one.component)] = self.parameters[one.name]["value"] / MM
        moved = np.eye(4)
        moved[:3, :3] = rotation(errors[3:])
        moved[:3, 3] = errors[:3]
        return np.asarray(model.start @ moved)

    def headline(self) -> str:
        """Rank, how well poses are predicted, and the verdict."""
        return (
            f"{self.rank} parameters from {self.fit.data.count} positions of "
            f"{self.fit.data.poses} poses, rms {self.loo_rms_mm:.3g} mm left out; verdict: "
            f"{self.verdict}"
        )

    @property
    def study(self) -> Study:
        """The question."""
        return self.setting.study

    @property
    def rank(self) -> int:
        """Number of parameters that the sheet tells apart."""
        return self.fit.rank

    @property
    def loo_rms_mm(self) -> float:
        """Root mean square distance of poses that were left out one by one [mm]."""
        return MM * self.fit.loo_rms

    @cached_property
    def rho0_mm(self) -> float | None:
        """The error of the markers to expect in the tasks, geometry and load compensated [mm].

        It is the root mean square distance that wrong parameters leave, over the tasks with their
        weights; what the model leaves out comes on top of it. Of full poses it is that of the
        positions. None without tasks.
        """
        poses = self.study.specification.test_poses
        if not poses:
            return None
        q = of_file_units(self.study.robot, np.array([pose.q_deg for pose in poses]))
        wrench = np.array([pose.load.build() for pose in poses])
        fitted = self.fit.fitted
        rows = fitted.columns(self.counting.turned(q), wrench, self.setting.loads)
        rows = rows[:, fitted.model.placed_rows]
        squares = np.einsum("mrp,pq,mrq->mr", rows, fitted.covariance, rows)
        weights = [pose.weight for pose in poses]
        return float(np.sqrt(3 * np.average(squares.mean(axis=1), weights=weights)))

    @property
    def assumed(self) -> tuple[str, ...]:
        """What no reading of the sheet can tell, each with what it costs where it is wrong."""
        reach = self.study.robot.reach
        lines = [
            "the scale of the instrument is right: all lengths would be wrong together, by "
            f"{1e-4 * MM * reach:.2g} mm at {reach:.2g} m for each 100 um/m; a known length tells"
        ]
        if self.fit.fitted.compliances.any():
            lines.append("the loads are as stated: 1 % of a load is 1 % of every compliance")
        return tuple(lines)

    @property
    def verdict(self) -> str:
        """Whether to use the result: "good", "usable" or "bad", as the worst doubt says."""
        least = Severity.WARNING if self.study.warnings else Severity.NOTE
        return VERDICTS[max([least, *(doubt.severity for doubt in self.doubts)])]

    @cached_property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """Value and standard deviation of each identified parameter, by name, in its unit."""
        fitted = self.fit.fitted
        return {
            one.name: {"value": float(value), "std": float(std), "unit": one.unit}
            for one, value, std in zip(
                fitted.model.parameters, fitted.values, fitted.std, strict=True
            )
        }

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, in the units of their names, with all that predictions need."""
        fit = self.fit
        names = self.study.specification.joints.unknown
        k = fit.fitted.compliances
        joint_names = self.study.robot.joint_names
        std: dict[str, float | None] = dict.fromkeys(names)
        for one, size in zip(fit.fitted.model.parameters, fit.fitted.std, strict=True):
            if one.place == "compliance":
                std[one.of] = float(size * one.scale)
        return {
            "rank": self.rank,
            "structural_rank": fit.structural,
            "rms_mm": MM * fit.rms,
            "loo_rms_mm": self.loo_rms_mm,
            "rho0_mm": self.rho0_mm,
            "placed_rms_mm": MM * fit.placed,
            **self._turns(),
            "parameters": self.parameters,
            "redundant": list(fit.redundant),
            "open": list(fit.open),
            "share_inside_left_out": fit.share_inside,
            # A spring that the sheet does not tell is not known to be rigid.
            "k": {
                name: None if std[name] is None else float(k[joint_names.index(name)])
                for name in names
            },
            "std": std,
            "verdict": self.verdict,
            "doubts": [doubt.text for doubt in self.doubts],
            "diagnostics": [doubt.to_dict() for doubt in self.doubts],
            "study_warnings": list(self.study.warnings),
            "assumed": list(self.assumed),
            "posterior": None if self.posterior is None else self.posterior.to_dict(),
            "geometry": {**geometry_to_dict(fit.fitted, self.counting), "study": self._marks()},
        }

    def sampled(
        self,
        rng: np.random.Generator,
        options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
    ) -> "GeometricCalibration":
        """The same calibration with the posterior, flat on all parameters before the positions.

        Args:
            rng: Source of randomness.
            options: How accurately a chain is sampled, where the parameters are few enough.

        Raises:
            UnconvergedError: The chain does not converge.
        """
        density = GeometryDensity.of(self.fit, self.setting.loads, self.robust)
        fitted = (self.fit.fitted.values, self.fit.fitted.std)
        found = geometry_posterior(density, fitted, rng, options)
        doubts = self.doubts
        if not found.trusted:
            doubts = (*doubts, GeometricDoubt(Severity.WARNING, "posterior", found.quality))
        return replace(self, posterior=found, doubts=doubts)

    def _marks(self) -> dict[str, Any]:
        """What tells whether a study that reads the result is the one that it was made for."""
        return {name: mark.tolist() for name, mark in study_marks(self.setting).items()}

    def _turns(self) -> dict[str, float]:
        """How well orientations fit and are predicted [deg], where they were measured."""
        turns = self.fit.turns
        if turns is None:
            return {}
        return {
            "turn_rms_deg": float(np.rad2deg(root_mean_square(turns.residual))),
            "turn_loo_rms_deg": float(np.rad2deg(root_mean_square(turns.left_out))),
        }

    def to_frame(self) -> "pd.DataFrame":
        """A row for each identified parameter: `parameter`, `value`, `std`, `unit`, `meaning`."""
        import pandas as pd

        parameters = self.fit.fitted.model.parameters
        table = pd.DataFrame.from_dict(self.parameters, orient="index")
        table = table.rename_axis("parameter").reset_index()
        return table.assign(meaning=[one.words for one in parameters])

    def residuals(self) -> "pd.DataFrame":
        """A row for each pose and marker: residuals of the fit, and with the pose left out [mm]."""
        import pandas as pd

        fit = self.fit
        pose, marker = np.nonzero(np.isfinite(fit.residual).all(axis=-1))
        columns: dict[str, Any] = {
            "pose": pose + 1,
            "marker": [fit.data.markers[i] for i in marker],
        }
        # Not x_mm and so on: a sheet with such columns is one with measurements.
        for name, values in (("residual_", fit.residual), ("left_out_", fit.left_out)):
            for axis in range(3):
                columns[f"{name}{'xyz'[axis]}_mm"] = MM * values[pose, marker, axis]
        turns = fit.turns
        if turns is not None:
            for name, values in (("residual_", turns.residual), ("left_out_", turns.left_out)):
                for axis in range(3):
                    degrees = np.rad2deg(values[pose, marker, axis])
                    columns[f"{name}r{'xyz'[axis]}_deg"] = degrees
        return pd.DataFrame(columns)

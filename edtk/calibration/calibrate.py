"""The compliances that a study's measurements give."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from edtk.calibration.diagnostics import Diagnostic, diagnostics
from edtk.calibration.input_errors import find_input_error
from edtk.calibration.plan_bias import bias_in_test_pose
from edtk.calibration.posterior_check import PosteriorCheck, check_posterior
from edtk.calibration.study_prior import study_prior
from edtk.design.plan import Plan
from edtk.inference.fit_huber import SigmaTooSmallError
from edtk.inference.identification import Identification
from edtk.inference.identify import NothingLeftError, identify
from edtk.inference.least_squares import Estimate, SingularPlanError
from edtk.inference.measurements import Measurements
from edtk.inference.prior import Flat
from edtk.inference.run_chain import Demand
from edtk.model.loads.fixed_load import FixedLoad
from edtk.report.calibration_report import identification_page
from edtk.study.study import Study
from edtk.system.atomic_file import atomic_path, require_writable, write_text
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.tables.pose_table import PoseFileError
from edtk.tables.sheet_columns import DEFLECTION_COLUMNS, ROTATION_COLUMNS

Array = NDArray[np.float64]
COORDINATES = (*DEFLECTION_COLUMNS, *ROTATION_COLUMNS)
VERDICTS = ("good", "warn", "bad")  # by the severity of the worst diagnostic
WRITTEN = ("k.json", "residuals.csv", "report.html")


@dataclass(frozen=True, eq=False)
class Calibration(Presented):
    """Identified compliances with what a person wants to know about them.

    Attributes:
        study: The question.
        data: The measurements.
        fit: Estimates and statistics.
        doubts: What looks wrong, the worst first.
        path: Where the measurements are.
        rho0_bias: Length of the mean error in the test pose that the linear model leaves [m]; None if it is unknown.
        check: The posterior; None where it was not sampled.
    """

    study: Study
    data: Measurements
    fit: Identification
    diagnostics: tuple[Diagnostic, ...]
    path: Path
    rho0_bias: float | None
    check: PosteriorCheck | None = None

    def headline(self) -> str:
        """The verdict, and the accuracy to expect."""
        rows = f"{len(self.data)} measurements of {self.data.pose.max() + 1} poses"
        accuracy = ""
        if self.study.target is not None:
            accuracy = f", rho0 = {1e3 * self.fit.accuracy(self.study.target)[0]:.4g} mm"
        return f"{len(self.fit.k)} compliances from {rows}{accuracy}; verdict: {self.verdict}"

    @property
    def verdict(self) -> str:
        """What to do with the result: "good", "warn" or "bad"."""
        worst = max((diagnostic.severity for diagnostic in self.diagnostics), default=0)
        return VERDICTS[worst]

    @property
    def sigma_hat(self) -> float:
        """Estimated noise of a position coordinate [m]: the scale times the root mean square of the given sigma."""
        return float(self.fit.scale * np.sqrt(np.mean(self.data.sigma[:, :3] ** 2)))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, SI, for JSON; what cannot be told is null."""
        fit, joints = self.fit, self.study.specification.joints.unknown
        rho0 = None
        if self.study.target is not None:
            value, interval = fit.accuracy(self.study.target)
            rho0 = {"value": value, "interval95": list(interval)}
        return {
            "k": dict(zip(joints, fit.k.tolist(), strict=True)),
            "std": dict(zip(joints, fit.std.tolist(), strict=True)),
            "correlation": fit.correlation.tolist(),
            "covariance_dof": fit.covariance_dof if np.isfinite(fit.covariance_dof) else None,
            "sigma_hat": self.sigma_hat if np.isfinite(fit.scale) else None,
            "chi2": fit.chi2,
            "dof": fit.dof,
            "p_value": fit.p_value,
            "outliers": (fit.outliers + 1).tolist(),
            "rho0": rho0,
            "rho0_bias": self.rho0_bias,
            "verdict": self.verdict,
            "doubts": [diagnostic.text for diagnostic in self.diagnostics],
            "negative": [
                joint for joint, yes in zip(joints, fit.negative.tolist(), strict=True) if yes
            ],
            "k_unbounded": dict(zip(joints, fit.unbounded.tolist(), strict=True)),
            "posterior": None if self.check is None else self.check.to_dict(),
        }

    def residuals(self) -> pd.DataFrame:
        """A row per measured coordinate: `row` and `pose` from 1, `coordinate` with the unit of `residual`."""
        m, rows = self.fit.residual.shape
        units = np.where(np.arange(rows) < 3, 1e3, 180 / np.pi)
        return pd.DataFrame(
            {
                "row": np.repeat(np.arange(1, m + 1), rows),
                "pose": np.repeat(self.data.pose + 1, rows),
                "coordinate": np.tile(COORDINATES[:rows], m),
                "residual": (self.fit.residual * units).ravel(),
                "leverage": self.fit.leverage.ravel(),
                "standardised": self.fit.standardised.ravel(),
            }
        )

    def write(self, folder: Path) -> None:
        """Write `k.json`, `residuals.csv` and `report.html`, each atomically."""
        for name in WRITTEN:
            require_writable(folder / name)
        with atomic_path(folder / "residuals.csv") as temporary:
            self.residuals().to_csv(temporary, index=False, float_format="%.10g")
        write_text(folder / "k.json", json.dumps(self.to_dict(), indent=2) + "\n")
        text = identification_page(
            self.study,
            self.fit,
            self.data.pose,
            self.path.name,
            self.diagnostics,
            self.rho0_bias,
            self.check,
        )
        write_text(folder / "report.html", text)

    def sampled(
        self,
        rng: np.random.Generator,
        progress: Callable[[int], object] = lambda steps: None,
        demand: Demand | None = None,
        chain: Path | None = None,
    ) -> "Calibration":
        """The same with the posterior, under the study's [prior].

        The noise is that of the [prior] too, but for what was asked of the fit: sigma is unknown (Jeffreys' prior)
        where it was estimated, and Student-t errors with unknown nu take the place of normal ones where it is robust.

        Args:
            rng: Source of randomness.
            progress: Called with the number of steps of the chain so far.
            demand: When the chain is long enough.
            chain: File in which the chain is kept, and from which it goes on.

        Raises:
            UserError: The study's prior is not one.
            UnconvergedError: The chain does not converge.
            ImproperPosteriorError: Too few measurements for what is unknown.
            ChainFileError: The file is no chain, or of another problem.
        """
        study, data, fit = self.study, self.data, self.fit
        A, noise = data.regressor(study.model), study.specification.prior.noise()
        if not fit.known:
            noise = replace(noise, sigma_factor=np.inf)
        if fit.robust and noise.normal:
            noise = replace(noise, nu=None)
        check = check_posterior(
            study,
            A,
            data.deflection,
            data.sigma,
            Estimate(fit.k, fit.covariance),
            rng,
            progress,
            noise=noise,
            demand=demand,
            chain=chain,
        )
        prior = study_prior(study)
        vague = prior.earlier is None and all(
            isinstance(marginal, Flat) for marginal in prior.marginals
        )
        estimated = vague and noise.normal and not fit.known and not fit.robust
        return replace(self, check=replace(check, sigma_estimated=estimated))


def calibrate(
    study: Study,
    path: Path | str,
    robust: bool = False,
    known: bool = True,
    plan: Plan | None = None,
) -> Calibration:
    """Identify the study's unknown compliances from a measurement file.

    Args:
        study: The question.
        path: The measurements (CSV), see `Measurements.from_csv`; poses need not be feasible.
        robust: Huber's loss instead of squares.
        known: Whether the given sigma is believed, or estimated from the residuals.
        plan: The plan that was to be carried out; poses that differ are named among the doubts.

    Raises:
        UserError: One line that names the file, and row and column where there are any.
    """
    path, load = Path(path), study.space.load
    wrench = load.always if isinstance(load, FixedLoad) else None
    try:
        data = Measurements.from_csv(path, study.robot, study.fixed, wrench, study.sigma)
    except PoseFileError as error:
        raise UserError(str(error)) from error
    A = data.regressor(study.model)
    try:
        fit = identify(A, data.deflection, data.sigma, study.model.parameters, robust, known)
    except (SingularPlanError, NothingLeftError, SigmaTooSmallError) as error:
        raise UserError(f"{path}: {error}") from error
    if wrong := find_input_error(study, data, fit, plan):
        raise UserError(f"{path}: {wrong}")
    rho0_bias = bias_in_test_pose(study, data, fit.k)
    return Calibration(
        study, data, fit, diagnostics(study, data, A, fit, plan, rho0_bias), path, rho0_bias
    )

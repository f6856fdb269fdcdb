"""A sampled posterior beside the covariance that Eq. (13) promises."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.pose_error import PoseError
from edtk.inference.noise import Noise
from edtk.inference.posterior import Posterior
from edtk.inference.whiten import RowNoise
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

NO_VARIANCE = 2  # degrees of freedom up to which Student's t has no variance


@dataclass(frozen=True, eq=False)
class PosteriorCheck(Presented):
    """One calibration, simulated or real, and its posterior.

    Attributes:
        table: One row per parameter, SI units: `parameter`, `unit`, `reference`, `mean`, `low_95`,
            `high_95`, `std_posterior`, `std_fit` (of a simulated calibration `std_eq13`), `ratio`,
            `ratio_error` (Monte-Carlo standard error of the ratio), `tau_steps`, `r_hat`,
            `effective_samples`.
        reference: The meaning of the column `reference`: "assumed truth" or "identified".
        posterior: The samples.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad], or correlated noise.
        noise: Assumptions about the noise.
        pose: Errors in the test pose; None without one.
        sigma_estimated: Whether posterior and fit both estimated the size of normal noise, and all
            priors are flat.
        untold: Names of the parameters that measurements alone do not tell, so that what is said of
            them is the prior's.
        coordinates: Names (rows,) of what a measurement holds; empty for those of its number of
            rows, as a position or a pose has them.
    """

    table: "pd.DataFrame"
    reference: str
    posterior: Posterior
    A: Array
    measured: Array
    sigma: RowNoise
    noise: Noise
    pose: PoseError | None
    sigma_estimated: bool = False
    untold: tuple[str, ...] = ()
    coordinates: tuple[str, ...] = ()

    def headline(self) -> str:
        """Number of compliances and measurements, and the range of the ratios."""
        ratio = self.table["ratio"]
        return (
            f"{len(self.table)} compliances from {len(self.A)} measurements, posterior over "
            f"{self.compared[1]}: {ratio.min():.3f} to {ratio.max():.3f}"
        )

    @property
    def noise_intervals(self) -> dict[str, tuple[float, float, float]]:
        """Median and ends of the 95 % interval of each unknown of the noise."""
        intervals = {}
        for i, name in enumerate(self.posterior.noise_names):
            ends = np.quantile(self.posterior.noise[..., i], [0.5, 0.025, 0.975])
            median, low, high = ends.tolist()
            intervals[name] = (median, low, high)
        return intervals

    @property
    def compared(self) -> tuple[str, str]:
        """The column beside posterior standard deviations, and its name for a person."""
        if self.untold:
            return ("std_fit", "normal approx.")
        if "std_eq13" in self.table:
            return ("std_eq13", "std by Eq. (13)")
        return ("std_fit", "std of the fit")

    @property
    def ratio_to_expect(self) -> float:
        """Posterior deviation over that of the fit, if both are right.

        That is sqrt(dof/(dof - 2)) where both estimate sigma, as Student's t is wider, else one.
        """
        dof = self.measured.size - len(self.table)
        if self.sigma_estimated and dof > NO_VARIANCE:
            return float(np.sqrt(dof / (dof - NO_VARIANCE)))
        return 1.0

    @property
    def rest(self) -> str:
        """What rests on the prior alone, in words; empty where nothing does."""
        if not self.untold:
            return ""
        return (
            f"measurements alone do not tell {', '.join(self.untold)}: what is said there rests on "
            "the prior; standard deviations are compared with a normal approximation of both"
        )

    def to_frame(self) -> "pd.DataFrame":
        """A copy of `table`."""
        return self.table.copy()

    def to_dict(self) -> dict[str, Any]:
        """Plain data, SI units."""
        names = ("median", "low_95", "high_95")
        return {
            "parameters": self.table.to_dict(orient="records"),
            "noise": {
                name: dict(zip(names, row, strict=True))
                for name, row in self.noise_intervals.items()
            },
            "test_pose": None if self.pose is None else self.pose.to_dict(),
            "steps": self.posterior.steps,
            "walkers": self.posterior.samples.shape[1],
        }

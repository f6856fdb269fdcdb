"""The Bayesian check: does the posterior have the covariance that the fit states?"""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.fit.correlated_noise import RowNoise, std_of
from edtk.fit.least_squares import Estimate, SingularPlanError, estimate
from edtk.fit.noise import Noise
from edtk.fit.posterior import NO_VARIANCE, Posterior, SamplingOptions, sample_posterior
from edtk.fit.prior import fit_with_prior
from edtk.fit.run_chain import autocorrelation_time
from edtk.measure.pose_table import coordinate_names
from edtk.measure.task import Task, Tasks
from edtk.study.study import Study
from edtk.study.study_parts import study_prior
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

AXES = 3
READING = ("reading", "parameter")  # what is measured, and of what, where a model is not linear
COLUMNS = (
    *("parameter", "unit", "reference", "mean", "low_95", "high_95", "std_posterior", "std_fit"),
    *("ratio", "ratio_error", "tau_steps", "r_hat", "effective_samples"),
)
SI = "m, or rad of a rotation"
MOST_NUMBERS = 30_000_000  # displacements in a file, 240 MB before they are packed


@dataclass(frozen=True, eq=False)
class PoseError(Presented):
    """The error after compensation with the least-squares estimate, by the posterior [m].

    A0 is the target of rho0: the test pose's regressor, unless a neighbourhood or rotations count
    too.

    Attributes:
        rho0: ``sqrt(E |A0 (k - k_hat)|^2)``.
        rho0_error: Its Monte-Carlo standard error.
        rho0_fit: ``sqrt(trace(A0 cov A0'))``, Eq. (20), with the covariance of the fit.
        error_95: Length that ``|A0 (k - k_hat)|`` does not exceed with a probability of 95 %.
        displacement: Mean of the displacement of the tool point under the task's load (3,); None
            where not compliances alone were identified.
        displacement_95: Ends of its 95 % intervals, by coordinate (2, 3); None likewise.
        place: Where rho0 is the error, in words.
        displaced: Which of several test poses the displacement is of, counted from 1: the one with
            the largest error; None for a single one.
    """

    rho0: float
    rho0_error: float
    rho0_fit: float
    error_95: float
    displacement: Array | None
    displacement_95: Array | None
    place: str = "in the test pose"
    displaced: int | None = None

    def headline(self) -> str:
        """The error after compensation."""
        return f"rho0 = {1e3 * self.rho0:.4g} mm {self.place}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data [m]."""
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
            if value is not None
        }


def pose_error(
    tasks: Tasks, fit: Estimate, posterior: Posterior, displaced: bool = True
) -> PoseError:
    """Find errors and displacements in the test poses.

    Args:
        tasks: The test poses. Their target says what counts as the error, the regressor of the
            worst of them how the tool point is displaced.
        fit: The estimate with which commands are compensated.
        posterior: The parameters that the robot may have, by draws of equal weight.
        displaced: Whether these are compliances alone, which displace the tool point.
    """
    target = tasks.target
    squares = (((posterior.samples - fit.k) @ target.T) ** 2).sum(axis=-1)
    rho0 = float(np.sqrt(squares.mean()))
    effective = squares.size / autocorrelation_time(squares[..., None])[0]
    found = PoseError(
        rho0=rho0,
        # The error of a mean of squares; of its root it is half that, relative to the root.
        rho0_error=float(squares.std() / np.sqrt(effective) / (2 * rho0)),
        rho0_fit=float(np.sqrt(np.trace(target @ fit.covariance @ target.T))),
        error_95=float(np.sqrt(np.quantile(squares, 0.95))),
        displacement=None,
        displacement_95=None,
        place=tasks.place,
    )
    if not displaced:
        return found
    dk = (posterior.samples - fit.k).reshape(-1, len(fit.k))
    second_moment = dk.T @ dk / len(dk)
    worst = int(np.argmax([np.sum((A @ second_moment) * A) for A in tasks.targets]))
    moved = posterior.samples @ tasks[worst].regressor.T
    return replace(
        found,
        displacement=moved.mean(axis=(0, 1)),
        displacement_95=np.quantile(moved, [0.025, 0.975], axis=(0, 1)),
        displaced=worst + 1 if len(tasks) > 1 else None,
    )


def first_estimate(
    study: Study, A: Array, measured: Array, sigma: RowNoise
) -> tuple[Estimate, tuple[str, ...]]:
    """Fit compliances by least squares; with the study's prior where these have no answer.

    Args:
        study: Names and prior.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise that broadcasts to (m, rows) [m, rad], or correlated noise.

    Returns:
        The estimate, and the names of the parameters that measurements alone do not tell.

    Raises:
        SingularPlanError: The prior does not tell these parameters either.
        UserError: The study's prior is not one.
    """
    names = study.model.parameters
    try:
        return estimate(A, measured, sigma, names), ()
    except SingularPlanError as error:
        prior = study_prior(study)
        return fit_with_prior(A, measured, sigma, names, prior), error.parameters


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
        A: Regressors (m, rows, p) [m or rad, a unit of each parameter]; where the model is not
            linear, those at the reference.
        measured: Deflections, or positions (m, rows) [m, rad]; NaN where nothing was measured.
        sigma: Noise (m, rows) [m, rad], or correlated noise.
        noise: Assumptions about the noise.
        pose: Errors in the test pose; None without one.
        sigma_estimated: Whether posterior and fit both estimated the size of normal noise, and all
            priors are flat.
        untold: Names of the parameters that measurements alone do not tell, so that what is said of
            them is the prior's.
        coordinates: Names (rows,) of what a measurement holds; empty for those of its number of
            rows, as a position or a pose has them.
        tasks: The task poses, of which a displacement under the load is asked.
        expected: What the reference lets expect (m, rows) [m, rad]; None for a linear model without
            a constant, whose `A @ k` it is.
        remark: What else is to be known of the comparison; empty for nothing.
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
    tasks: Sequence[Task] = ()
    expected: Array | None = None
    remark: str = ""

    def headline(self) -> str:
        """Number of parameters and measurements, and the range of the ratios."""
        ratio = self.table["ratio"]
        return (
            f"{len(self.table)} parameters from {len(self.A)} measurements, posterior over "
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
    def predicted(self) -> Array:
        """What the posterior's mean predicts (m, rows) [m, rad], to the first order."""
        mean = self.posterior.mean
        if self.expected is None:
            return np.asarray(self.A @ mean)
        return np.asarray(self.expected + self.A @ (mean - self.table["reference"].to_numpy()))

    @property
    def rest(self) -> str:
        """What rests on the prior alone, or else is to be known, in words; empty for nothing."""
        if not self.untold:
            return self.remark
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
            "method": self.posterior.method,
            "effective_share": self.posterior.effective_share,
            "trusted": self.posterior.trusted,
        }


def check_posterior(
    study: Study,
    A: Array,
    measured: Array,
    sigma: RowNoise,
    identified: Estimate,
    rng: np.random.Generator,
    *,
    noise: Noise | None = None,
    options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
) -> PosteriorCheck:
    """Sample the posterior of measurements, and compare standard deviations.

    Args:
        study: Priors, names and test pose.
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad], or correlated noise.
        identified: The estimate from these measurements. Its covariance is Eq. (13), corrected
            where sigma was estimated, or where the loss was not least squares; that of
            `first_estimate` where there are none.
        rng: Source of randomness.
        noise: Assumptions about the noise; default to those of the study.
        options: How accurately, and where the chain is kept.

    Raises:
        UserError: The study's prior is not one.
        SingularPlanError: Neither measurements nor prior tell a parameter.
        UnconvergedError: The chain does not converge.
        ImproperPosteriorError: Too few measurements for the unknowns.
        ChainFileError: The file is no chain, or of another problem.
    """
    assumed = study.specification.prior.noise() if noise is None else noise
    fit, untold = first_estimate(study, A, measured, sigma)
    prior = study_prior(study)
    posterior = sample_posterior(
        A, measured, sigma, fit, rng, prior=prior, noise=assumed, options=options
    )
    names = study.model.parameters
    std = np.sqrt(np.diag(identified.covariance))
    posterior = replace(posterior, parameters=names, units=study.model.units)
    table = compared_with_fit(posterior, identified.k, std)
    # Without a least-squares fit the posterior's mean is what commands are compensated with.
    used = Estimate(posterior.mean, posterior.covariance) if untold else identified
    pose = pose_error(study.tasks, used, posterior) if study.tasks else None
    return PosteriorCheck(
        table,
        "identified",
        posterior,
        A,
        measured,
        sigma,
        assumed,
        pose,
        untold=untold,
        tasks=study.tasks,
    )


def compared_with_fit(posterior: Posterior, estimates: Array, std: Array) -> "pd.DataFrame":
    """The rows of `PosteriorCheck.table`.

    Args:
        posterior: With names and units.
        estimates: Those of the fit (p,).
        std: Their standard deviations (p,).
    """
    own = posterior.to_frame().rename(columns={"std": "std_posterior"})
    own["reference"] = estimates
    own["std_fit"] = std
    own["ratio"] = own["std_posterior"] / std
    own["ratio_error"] = own["std_error"] / std
    return own[list(COLUMNS)]


@contextmanager
def _without_warnings() -> Iterator[None]:
    """ArviZ announces its successor at every import, and other things while it writes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def require_arviz(path: Path | str) -> None:
    """Check, before long work, that ArviZ is installed.

    Args:
        path: The file that it is needed for.

    Raises:
        UserError: It is not installed.
    """
    try:
        with _without_warnings():
            import arviz  # noqa: F401
    except ModuleNotFoundError:
        message = "the export needs the extra edtk[posterior], which is not installed"
        raise UserError(message, where=path) from None


def inference_data(check: PosteriorCheck) -> bytes:
    """The content of a NetCDF file of posterior and measurements; walkers are ArviZ's chains.

    Weighted draws are as they were drawn, their weights in `sample_stats`. The displacements in
    task poses [m] are left out where they are so many that the file would be too large: the
    regressors of the poses give them for any draw. The content is made in memory: where a disk is
    full, HDF5 ends the whole process.

    Args:
        check: The posterior.
    """
    posterior = check.posterior
    targets = np.array([task.regressor for task in check.tasks])
    measured, parameter = ("deflection", "compliance") if check.expected is None else READING
    rows = ["experiment", "row"]
    constant = {"regressor": check.A, "sigma": std_of(check.sigma)}
    if check.expected is not None:
        constant["by_fit"] = check.expected
    if len(targets) > 1:
        constant["task_regressor"] = targets
    displacement, of_displacement = _displacement(posterior.samples, targets)
    with _without_warnings():
        import arviz

        data = arviz.from_dict(
            posterior=_variables(check) | displacement,
            sample_stats=None if posterior.weights is None else {"weight": posterior.weights.T},
            observed_data={measured: check.measured},
            constant_data=constant,
            coords={
                "axis": ["x", "y", "z"],
                "row": list(check.coordinates or coordinate_names(check.A.shape[1])),
                parameter: check.table["parameter"].tolist(),
            },
            dims={
                measured: rows,
                "by_fit": rows,
                "sigma": rows,
                "regressor": [*rows, parameter],
                "task_regressor": ["task_pose", "axis", parameter],
                "displacement": of_displacement,
            },
            posterior_attrs={"sampler": posterior.method, "steps": posterior.steps},
        )
        units = dict(zip(check.table["parameter"], check.table["unit"], strict=True))
        lengths = dict.fromkeys((measured, "by_fit", "sigma"), SI)
        return _netcdf(data, units | {"displacement": "m"} | lengths)


def _displacement(samples: Array, targets: Array) -> tuple[dict[str, Any], list[str]]:
    """Displacements in task poses by all draws, and their dimensions; nothing where too many."""
    if len(targets) == 1:
        return {"displacement": np.swapaxes(samples @ targets[0].T, 0, 1)}, ["axis"]
    draws = np.prod(samples.shape[:2])
    if not len(targets) or draws * len(targets) * AXES > MOST_NUMBERS:
        return {}, []
    return {"displacement": np.einsum("sdp,tap->dsta", samples, targets)}, ["task_pose", "axis"]


def _netcdf(data: Any, units: dict[str, str]) -> bytes:
    """The groups of data, compressed, with units of their variables."""
    import xarray

    groups = {f"/{name}": data[name] for name in data.groups()}
    for group in groups.values():
        del group.attrs["created_at"]  # the same run writes the same bytes
        for name in units.keys() & group.data_vars.keys():
            group[name].attrs["units"] = units[name]
    packed = {
        name: {variable: {"zlib": True} for variable in group.data_vars}
        for name, group in groups.items()
    }
    tree = xarray.DataTree.from_dict(groups)
    return bytes(tree.to_netcdf(engine="h5netcdf", encoding=packed))


def _variables(check: PosteriorCheck) -> dict[str, Any]:
    """Samples (walkers, steps) of the compliances and of the noise."""
    posterior = check.posterior
    variables: dict[str, Any] = {}
    for i, name in enumerate(check.table["parameter"]):
        variables[name] = posterior.samples[..., i].T
    for i, name in enumerate(posterior.noise_names):
        variables[name] = posterior.noise[..., i].T
    return variables

"""A posterior as ArviZ InferenceData, in a NetCDF file."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.system.atomic_file import atomic_path
from edtk.system.errors import UserError

Array = NDArray[np.float64]


def require_arviz(path: Path | str) -> None:
    """Check, before long work, that ArviZ is there.

    Raises:
        UserError: It is not.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # ArviZ announces its successor at every import
            import arviz  # noqa: F401
    except ModuleNotFoundError:
        raise UserError(
            f"{path}: the export needs the extra edtk[posterior], which is not installed"
        ) from None


def export_inference_data(
    check: PosteriorCheck, path: Path | str, target: Array | None = None
) -> None:
    """Write posterior and measurements; walkers are ArviZ's chains.

    Args:
        check: The posterior.
        path: Where to write.
        target: A0 (3, p) of the test pose, for the posterior of the displacement under the task's load [m]; or None.

    Raises:
        UserError: ArviZ is missing.
        OSError: The file cannot be written.
    """
    require_arviz(path)
    posterior = check.posterior
    names = [*check.table["parameter"], *posterior.noise_names]
    columns = [*(posterior.samples[..., i].T for i in range(len(check.table)))]
    columns += [posterior.noise[..., i].T for i in range(len(posterior.noise_names))]
    moved = (
        {} if target is None else {"displacement": np.swapaxes(posterior.samples @ target.T, 0, 1)}
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import arviz

        data = arviz.from_dict(
            posterior=dict(zip(names, columns, strict=True)) | moved,
            observed_data={"deflection": check.measured},
            constant_data={"regressor": check.A, "sigma": check.sigma},
            coords={"axis": ["x", "y", "z"]},
            dims={
                "displacement": ["axis"],
                "deflection": ["experiment", "row"],
                "regressor": ["experiment", "row", "compliance"],
                "sigma": ["experiment", "row"],
            },
            posterior_attrs={"sampler": "emcee", "steps": posterior.steps},
        )
        for name, unit in zip(check.table["parameter"], check.table["unit"], strict=True):
            data.posterior[name].attrs["units"] = unit
        for name in moved:
            data.posterior[name].attrs["units"] = "m"
        with atomic_path(path) as temporary:
            temporary.unlink()  # an empty file is no NetCDF file that could be added to
            data.to_netcdf(str(temporary))

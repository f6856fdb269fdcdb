"""A posterior as ArviZ InferenceData, in a NetCDF file."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.system.atomic_file import atomic_path
from edtk.system.errors import UserError
from edtk.system.typing import Array

DIMENSIONS = {
    "displacement": ["axis"],
    "deflection": ["experiment", "row"],
    "regressor": ["experiment", "row", "compliance"],
    "sigma": ["experiment", "row"],
}


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


def export_inference_data(
    check: PosteriorCheck, path: Path | str, target: Array | None = None
) -> None:
    """Write posterior and measurements; walkers are ArviZ's chains.

    Args:
        check: The posterior.
        path: Where to write.
        target: A0 (3, p) of the test pose, for the posterior of the displacement under the task's
            load [m]; or None.

    Raises:
        UserError: ArviZ is not installed.
        OSError: The file cannot be written.
    """
    require_arviz(path)
    with _without_warnings():
        import arviz

        data = arviz.from_dict(
            posterior=_variables(check, target),
            observed_data={"deflection": check.measured},
            constant_data={"regressor": check.A, "sigma": check.sigma},
            coords={"axis": ["x", "y", "z"]},
            dims=DIMENSIONS,
            posterior_attrs={"sampler": "emcee", "steps": check.posterior.steps},
        )
        for name, unit in zip(check.table["parameter"], check.table["unit"], strict=True):
            data.posterior[name].attrs["units"] = unit
        if target is not None:
            data.posterior["displacement"].attrs["units"] = "m"
        with atomic_path(path) as temporary:
            temporary.unlink()  # an empty file is no NetCDF file that could be added to
            data.to_netcdf(str(temporary))


def _variables(check: PosteriorCheck, target: Array | None) -> dict[str, Any]:
    """Samples (walkers, steps) of the compliances, of the noise, and of the displacement."""
    posterior = check.posterior
    variables: dict[str, Any] = {}
    for i, name in enumerate(check.table["parameter"]):
        variables[name] = posterior.samples[..., i].T
    for i, name in enumerate(posterior.noise_names):
        variables[name] = posterior.noise[..., i].T
    if target is not None:
        variables["displacement"] = np.swapaxes(posterior.samples @ target.T, 0, 1)
    return variables

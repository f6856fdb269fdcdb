"""A posterior as ArviZ InferenceData, in a NetCDF file."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.inference.whiten import std_of
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


def inference_data(check: PosteriorCheck, target: Array | None = None) -> bytes:
    """The content of a NetCDF file of posterior and measurements; walkers are ArviZ's chains.

    It is made in memory: where a disk is full, HDF5 ends the whole process.

    Args:
        check: The posterior.
        target: A0 (3, p) of the test pose, for the posterior of the displacement under the task's
            load [m]; or None.
    """
    with _without_warnings():
        import arviz
        import xarray

        data = arviz.from_dict(
            posterior=_variables(check, target),
            observed_data={"deflection": check.measured},
            constant_data={"regressor": check.A, "sigma": std_of(check.sigma)},
            coords={"axis": ["x", "y", "z"]},
            dims=DIMENSIONS,
            posterior_attrs={"sampler": "emcee", "steps": check.posterior.steps},
        )
        for name, unit in zip(check.table["parameter"], check.table["unit"], strict=True):
            data.posterior[name].attrs["units"] = unit
        if target is not None:
            data.posterior["displacement"].attrs["units"] = "m"
        groups = {f"/{name}": data[name] for name in data.groups()}
        packed = {
            name: {variable: {"zlib": True} for variable in group.data_vars}
            for name, group in groups.items()
        }
        tree = xarray.DataTree.from_dict(groups)
        return bytes(tree.to_netcdf(engine="h5netcdf", encoding=packed))


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

"""A posterior as ArviZ InferenceData, in a NetCDF file."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.inference.whiten import std_of
from edtk.model.task import Task
from edtk.system.errors import UserError

AXES = 3
MOST_NUMBERS = 30_000_000  # displacements in a file, 240 MB before they are packed
DIMENSIONS = {
    "deflection": ["experiment", "row"],
    "regressor": ["experiment", "row", "compliance"],
    "sigma": ["experiment", "row"],
    "task_regressor": ["task_pose", "axis", "compliance"],
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


def inference_data(check: PosteriorCheck, tasks: Sequence[Task] = ()) -> bytes:
    """The content of a NetCDF file of posterior and measurements; walkers are ArviZ's chains.

    It is made in memory: where a disk is full, HDF5 ends the whole process.

    Args:
        check: The posterior.
        tasks: The task poses, for the posterior of the displacement under the load of each [m].
            It is left out where they are so many that the file would be too large: the regressors
            of the poses give it for any draw.
    """
    targets = np.array([task.regressor for task in tasks])
    drawn = int(np.prod(check.posterior.samples.shape[:2]))
    variables = _variables(check)
    dimensions = dict(DIMENSIONS)
    if len(tasks) == 1:
        variables["displacement"] = np.swapaxes(check.posterior.samples @ targets[0].T, 0, 1)
        dimensions["displacement"] = ["axis"]
    elif len(tasks) and drawn * len(tasks) * AXES <= MOST_NUMBERS:
        moved = np.einsum("sdp,tap->dsta", check.posterior.samples, targets)
        variables["displacement"] = moved
        dimensions["displacement"] = ["task_pose", "axis"]
    constant = {"regressor": check.A, "sigma": std_of(check.sigma)}
    if len(tasks) > 1:
        constant["task_regressor"] = targets
    with _without_warnings():
        import arviz
        import xarray

        data = arviz.from_dict(
            posterior=variables,
            observed_data={"deflection": check.measured},
            constant_data=constant,
            coords={"axis": ["x", "y", "z"]},
            dims=dimensions,
            posterior_attrs={"sampler": "emcee", "steps": check.posterior.steps},
        )
        for name, unit in zip(check.table["parameter"], check.table["unit"], strict=True):
            data.posterior[name].attrs["units"] = unit
        if "displacement" in variables:
            data.posterior["displacement"].attrs["units"] = "m"
        groups = {f"/{name}": data[name] for name in data.groups()}
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

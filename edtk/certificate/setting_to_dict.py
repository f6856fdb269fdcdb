"""The setting of a study's designs as a certificate holds it."""

from typing import Any

import numpy as np

from criteria.linalg.inverse import ROUNDING
from criteria.linalg.root import unit_spectrum
from edtk.certificate.feasible_to_dict import feasible_to_dict
from edtk.certificate.noise_to_dict import noise_to_dict
from edtk.certificate.physics_to_dict import physics_to_dict, weights_to_list
from edtk.design.design_space import DesignSpace
from edtk.model.task import Task
from edtk.study.study import Study
from edtk.system.typing import Array


def setting_to_dict(study: Study, space: DesignSpace) -> dict[str, Any]:
    """Write robot, load, noise, constraints and test pose as plain data.

    All is in SI units and radians, but for the study's own keys, which name their units.

    Args:
        study: The study.
        space: The design space that was searched, with the poses that it excludes.
    """
    feasible = feasible_to_dict(study, space)
    return {
        "robot": feasible["robot"],
        "unknown": list(study.model.joints),
        "rows": study.model.rows,
        **(noise_to_dict(study.noise) or {"sigma": study.sigma.tolist()}),
        "load": _load(study),
        "workspace": feasible["workspace"],
        "excluded": feasible["excluded"],
        "free": feasible["free"],
        "fixed": feasible["fixed"],
        **({"margin": feasible["margin"]} if any(feasible["margin"]) else {}),
        "test_pose": _test_pose(study),
        **physics_to_dict(study.model),
        **({} if study.interest is None else {"interest": study.interest.tolist()}),
        **({} if study.prior_information is None else {"prior": _prior(study.prior_information)}),
    }


def _prior(information: Array) -> list[list[float]]:
    """Rows F (r, p) of measurements that tell as much as the prior: ``F'F`` is its information."""
    r, V, d = unit_spectrum(information)
    kept = r > len(r) * ROUNDING * r[-1]
    return (np.sqrt(r[kept])[:, None] * V[:, kept].T * d).tolist()


def _load(study: Study) -> dict[str, Any]:
    """The keys of the load; a payload in its stead is the force of its weight."""
    keys = study.specification
    if keys.load is not None:
        return keys.load.model_dump(mode="json", exclude_none=True, exclude={"at_mm"})
    return {"F_N": keys.build_load().wrench(np.zeros(0))[:3].tolist(), "T_Nm": [0.0, 0.0, 0.0]}


def _test_pose(study: Study) -> dict[str, Any] | list[dict[str, Any]] | None:
    """The task, several tasks with their weights, or None."""
    if len(study.tasks) < 2:
        return _task(study.tasks[0]) if study.tasks else None
    return [_task(task) | {"weight": task.weight} for task in study.tasks]


def _task(task: Task) -> dict[str, Any]:
    """Pose [rad or m], tool [m] and wrench [N, N m] of a task.

    Where a neighbourhood [rad] or rotations [m] count, their size follows.
    """
    hanging = task.dead_weights
    sizes = {"within": task.within, "lever": task.lever}
    return {
        "q": task.q.tolist(),
        "tool": task.model.robot.tool.tolist(),
        "wrench": task.wrench.tolist(),
        **{name: size for name, size in sizes.items() if size},
        **({} if hanging is None else {"weights": weights_to_list(hanging)}),
    }

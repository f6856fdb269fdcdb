"""What proves the numbers of a relaxation or of an exact plan, as plain data."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

import criteria
from criteria.worst_task_accuracy import WorstTaskAccuracy
from edtk.certificate.setting_to_dict import setting_to_dict
from edtk.design.bound import BoundKind
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.system.parsing import json_text
from edtk.version import __version__

NONE: Mapping[tuple[int, ...], RelaxedPlan] = MappingProxyType({})


def certificate(
    study: Study,
    found: RelaxedPlan | ExactPlan,
    setting: dict[str, Any] | None = None,
    day: dict[str, Any] | None = None,
    proofs: Mapping[tuple[int, ...], RelaxedPlan] = NONE,
) -> dict[str, Any]:
    """Collect all that `verify_certificate` needs: setting, experiments, multipliers and claims.

    The content stands alone: robot, load, noise and constraints are part of it, in SI units and
    radians, but for the study's own keys, which name their units.

    Args:
        study: The study that was answered.
        found: A relaxation, or an exact plan of this study.
        setting: Robot, load, noise and constraints as plain data; defaults to `setting_to_dict`,
            which knows studies of compliances alone.
        day: What visits and load changes of a plan cost, and its budget; None without one.
        proofs: The relaxations of all sets of loads that the budget pays for.

    Returns:
        Plain data for JSON.
    """
    if isinstance(found, ExactPlan):
        relaxed = found.relaxed
        answer = {
            "kind": "plan",
            "claims": _plan_claims(found),
            "experiments": _repeated(found.plan),
            "kept": [] if found.kept is None else _repeated(found.kept),
        }
        if day is not None:
            answer["day"] = day
    else:
        relaxed = found
        answer = {
            "kind": "relaxation",
            "claims": _relaxation_claims(found),
            "experiments": _weighted(found),
            "kept": [],
        }
    return {
        "edtk": __version__,
        "title": study.specification.title,
        "study_sha256": study.digest,
        "criterion": relaxed.criterion.name,
        **answer,
        "proof": _proof(relaxed) if day is None else _proofs(proofs),
        "setting": setting_to_dict(study, relaxed.space) if setting is None else setting,
        **_sharing(study, found),
    }


def is_certifiable(name: str) -> bool:
    """Whether certificates of poses can be about a criterion: it needs no parameters."""
    return not criteria.get(name).needs_parameters


def require_certifiable(study: Study, name: str | None, path: Path | str | None) -> None:
    """Check, before a long search, that its certificate can be written.

    Args:
        study: The study.
        name: Name of the criterion; None for the one that the study is about.
        path: The file of the certificate; None where none is asked for.

    Raises:
        UserError: No certificate of poses tells the parameters of the criterion.
    """
    name = study.main_criterion if name is None else name
    if path is not None and name in criteria.families():
        raise UserError(
            f"criterion {name!r} has no certificate of poses, as it has parameters; leave the "
            "certificate out",
            where=study.where,
        )


def _sharing(study: Study, found: RelaxedPlan | ExactPlan) -> dict[str, int]:
    """How many experiments share the study's prior, which weights do not tell."""
    if study.prior_information is None or isinstance(found, ExactPlan):
        return {}
    return {"sharing": found.space.sharing}


def certificate_text(
    study: Study,
    found: RelaxedPlan | ExactPlan,
    setting: dict[str, Any] | None = None,
    day: dict[str, Any] | None = None,
    proofs: Mapping[tuple[int, ...], RelaxedPlan] = NONE,
) -> str:
    """The text of the certificate file of a result, see `certificate`."""
    return json_text(certificate(study, found, setting, day, proofs), indent=1) + "\n"


def _proofs(proofs: Mapping[tuple[int, ...], RelaxedPlan]) -> list[dict[str, Any]]:
    """A proof for each set of loads."""
    return [{"loads": list(loads), **_proof(one)} for loads, one in proofs.items()]


def _proof(relaxed: RelaxedPlan) -> dict[str, Any]:
    """Multipliers, and the experiments over which their largest sensitivities are taken.

    To a multiplier of rho_max belong weights of the tasks, see `WorstTaskAccuracy.dual_weights`.
    """
    searched = relaxed.searched_sensitivities
    criterion = relaxed.criterion
    weights = {}
    if isinstance(criterion, WorstTaskAccuracy):
        M = relaxed.information
        weights["task_weights"] = [
            criterion.dual_weights(Z, M).tolist() for Z in relaxed.multipliers
        ]
    return {
        "candidates": relaxed.candidates,
        "seed": list(relaxed.source.seeds),
        "sampling": relaxed.source.sampling,
        "multipliers": relaxed.multipliers.tolist(),
        **weights,
        "support": relaxed.x.tolist(),
        "searched": [] if searched is None else searched.x.tolist(),
    }


def _relaxation_claims(found: RelaxedPlan) -> dict[str, float]:
    """Value, bounds and proved gap; a bound that says nothing is no claim."""
    claims = {"value": found.value, "bound": found.bound, "gap": found.gap}
    if found.searched_bound is not None:
        claims["bound_searched"] = found.searched_bound.value
    return {name: float(number) for name, number in claims.items() if np.isfinite(number)}


def _plan_claims(found: ExactPlan) -> dict[str, float]:
    """Value, bound of its kind, and the efficiency beside a bound over all poses.

    A plan's poses need not be among the candidates: beside a bound over these alone, its efficiency
    says as much about them as about the plan.
    """
    claims = {"value": found.value, "bound": found.bound}
    if found.lower_bound.kind is BoundKind.SEARCHED:
        claims = {
            "value": found.value,
            "bound_searched": found.bound,
            "efficiency": found.efficiency,
        }
    return {name: float(number) for name, number in claims.items() if np.isfinite(number)}


def _weighted(found: RelaxedPlan) -> list[dict[str, Any]]:
    """Experiments with their weights, in the design's own order."""
    plan = found.space.plan(found.x, np.ones(len(found.x), dtype=int))
    return [
        {"q": q.tolist(), "wrench": wrench.tolist(), "weight": float(weight)}
        for q, wrench, weight in zip(plan.q, plan.wrench, found.weights, strict=True)
    ]


def _repeated(plan: Plan) -> list[dict[str, Any]]:
    """Experiments with their repetitions."""
    return [
        {"q": q.tolist(), "wrench": wrench.tolist(), "repeats": int(repeats)}
        for q, wrench, repeats in zip(plan.q, plan.wrench, plan.repeats, strict=True)
    ]

"""`edtk.verify`: the claims of a certificate, recomputed."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.certificate.proof import MOST_MB
from edtk.certificate.verify_certificate import Claim, Verification, verify_certificate
from edtk.certificate.verify_exact import KIND as OF_PLAN
from edtk.certificate.verify_exact import verify_exact
from edtk.certificate.verify_problem import KIND, verify_problem
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, UserError, whole_number
from edtk.system.files import read_text
from edtk.system.parsing import parse_json
from edtk.verbs.of_kinds import of_study

if TYPE_CHECKING:
    from edtk.design.exact.day import DayCosts
    from edtk.study.study import Study
    from edtk.verbs.inputs import PlanLike, StudyLike

OF_PROBLEMS = {KIND: verify_problem, OF_PLAN: verify_exact}


@checked
def verify(
    certificate: Path | str | dict[str, Any],
    study: "StudyLike | Problem | None" = None,
    *,
    size: int | None = None,
    keep: "PlanLike | None" = None,
    exclude: Path | str | None = None,
    cost_budget: float | None = None,
) -> Verification:
    """Recompute every claim of a certificate from its poses and multipliers alone.

    The check shares no code with the search. Of a study's design it has a kinematics, an
    information matrix and bounds of its own, and draws the candidates anew. The certificate holds
    robot, load, noise and limits; whether these are the right ones, only the study can tell, which
    is read as everywhere.

    Of a `Problem`, the check takes the rows as it keeps them, divided by sigma, or squares, and the
    prior. Value and bound are recomputed from these, the weights and multipliers: every criterion
    and its bound is written down a second time. Criteria of plug-ins are not; their claims do not
    hold, and the result says why.

    Args:
        certificate: The file that `edtk.plan`, `edtk.relax` or `edtk.run` wrote, or its content.
        study: A study, or its file, whose setting the certificate must have; defaults to none, and
            then the certificate's own setting is taken as given. A certificate of a `Problem`, as
            `Relaxation.to_dict` makes it, needs that problem here.
        size: Number of experiments that was asked for, kept ones counted, as `edtk.plan` had it or
            `edtk.relax` where something is known beforehand; with a study. Defaults to any number
            of a plan, and to the study's sizes for weights beside a prior.
        keep: The experiments that were made before, as `edtk.plan` had them; with a study, a
            certificate takes no others as made.
        exclude: The poses that plans stay away from besides those that the study names, likewise.
        cost_budget: What a day may cost, as `edtk.plan` had it; defaults to the study's.

    Returns:
        Each claim with the stated and the recomputed number; `.valid` if all hold.

    Raises:
        UserError: A file cannot be read, or is no certificate or no study.

    Example:
        >>> import edtk
        >>> edtk.verify("plan.json").valid  # doctest: +SKIP
        True
    """
    if isinstance(certificate, dict):
        where = "certificate"
        content: Any = certificate
    else:
        where = str(certificate)
        content = parse_json(read_text(certificate, MOST_MB), where)
    if isinstance(content, dict) and str(content.get("kind")) in OF_PROBLEMS:
        return _of_problem(content, study, where)
    if not isinstance(content, dict) or "proof" not in content:
        raise UserError("not a certificate; expected a file written by --certificate", where=where)
    try:
        found = verify_certificate(content)
    except ValueError as error:
        raise UserError(f"not a certificate: {error}", where=where) from error
    if study is None:
        given = {"size": size, "keep": keep, "exclude": exclude, "cost_budget": cost_budget}
        for argument, value in given.items():
            if value is not None:
                message = "what a plan was asked for goes with a study; expected one"
                raise ArgumentError(message, argument=argument)
        return found
    if isinstance(study, Problem):
        message = "this is a certificate of poses; expected a study beside it, not a problem"
        raise UserError(message, where=where)
    from edtk.verbs.inputs import as_study

    asked = as_study(study)
    if exclude is not None:
        asked = asked.excluding(exclude)
    questions = _other_size(content, found, asked, size)
    beside = _beside_study(content, asked, keep, cost_budget, questions)
    return replace(
        found,
        claims=(*beside, *found.claims),
        of_study=True,
        other_seed=_other_seed(content, asked),
    )


def _of_problem(content: dict[str, Any], problem: object, where: str) -> Verification:
    """Check a certificate of a problem of arrays."""
    if not isinstance(problem, Problem):
        raise UserError(
            "this is a certificate of a problem of arrays; expected that problem beside it, in "
            "Python: edtk.verify(certificate, problem); of a region it is design.on_grid().problem",
            where=where,
        )
    try:
        return OF_PROBLEMS[content["kind"]](content, problem)
    except ValueError as error:
        raise UserError(f"not a certificate: {error}", where=where) from error


def _beside_study(
    content: dict[str, Any],
    study: "StudyLike",
    keep: "PlanLike | None",
    cost_budget: float | None,
    others: list[str],
) -> tuple[Claim, Claim]:
    """The claims that a certificate's setting, and what it asks, are those of a study.

    Args:
        content: The certificate.
        study: The study.
        keep: The experiments that were made before.
        cost_budget: What a day may cost, where the study does not say.
        others: What else of the question is another one.
    """
    # Imported late: studies bring pydantic, which the check of a file alone need not pay.
    from edtk.design.exact.day import DayCosts
    from edtk.study.plan_study import day_costs
    from edtk.verbs.inputs import as_plan

    question = of_study(study)
    known = question.study
    expected = json.loads(json.dumps(question.setting(content["criterion"])))
    stated = content["setting"]
    keys = [*expected, *(key for key in stated if key not in expected)]
    other = [key for key in keys if stated.get(key) != expected.get(key)]
    costs = day_costs(known, cost_budget) or DayCosts()
    other += _other_costs(content, costs)
    reason = f"the study has another {', '.join(other)}" if other else ""
    questions = [
        *others,
        *_other_candidates(content, known),
        *_other_budget(content, costs),
        *_other_kept(content, None if keep is None else as_plan(known, keep)),
    ]
    return (
        Claim("study", not other, None, None, reason),
        Claim("question", not questions, None, None, "; ".join(questions)),
    )


def _other_costs(content: dict[str, Any], costs: "DayCosts") -> list[str]:
    """What a day costs, where that is not what the study says."""
    if "day" not in content:
        return []
    stated = content["day"]
    # The budget is another claim, and so is the size.
    expected = replace(costs, budget=stated["budget"]).to_dict(stated["visits"]) or {}
    keys = [*expected, *(key for key in stated if key not in expected)]
    return [f"cost {key}" for key in keys if stated.get(key) != expected.get(key)]


def _other_candidates(content: dict[str, Any], study: "Study") -> list[str]:
    """How the candidates are fewer, or drawn in another way, than the study says."""
    keys = study.specification
    proofs = _proofs(content)
    fewest = min(proof["candidates"] for proof in proofs)
    found = []
    if fewest < keys.candidates:
        found.append(f"the study has {keys.candidates} candidates, and the certificate {fewest}")
    if any(proof["sampling"] != keys.sampling for proof in proofs):
        found.append(f"the study's candidates are {keys.sampling}")
    return found


def _other_seed(content: dict[str, Any], study: "Study") -> bool:
    """Whether candidates are drawn by another seed, which is no other question."""
    from edtk.study.plan_study import CANDIDATE_STREAM

    own = [study.specification.seed, CANDIDATE_STREAM]
    return any(proof["seed"] != own for proof in _proofs(content))


def _proofs(content: dict[str, Any]) -> list[dict[str, Any]]:
    """The proof, or one for each set of loads."""
    return content["proof"] if isinstance(content["proof"], list) else [content["proof"]]


def _other_size(
    content: dict[str, Any], found: Verification, study: "Study", size: int | None
) -> list[str]:
    """How a certificate is about another number of experiments than asked for.

    Weights have a size only where experiments share what is known beforehand: the more of them,
    the smaller is the share of each.

    Raises:
        ArgumentError: The size is no whole number, or goes with weights that have none.
    """
    asked = None if size is None else whole_number(size, "size", 1)
    if found.kind == "plan":
        number = found.experiments + found.kept
        words = f"the plan has {number} experiments, kept ones counted"
        return [] if asked in (None, number) else [f"{words}, and {asked} are asked for"]
    if not found.prior:
        if asked is not None:
            message = "weights have no size without a prior in the design; expected none"
            raise ArgumentError(message, argument="size", given=asked)
        return []
    sizes = study.specification.sizes if asked is None else (asked,)
    if content["sharing"] in sizes:
        return []
    words = f"{content['sharing']} experiments share what is known beforehand"
    return [f"{words}; expected {' or '.join(map(str, sizes))}, or their number beside the study"]


def _other_budget(content: dict[str, Any], costs: "DayCosts") -> list[str]:
    """How a plan's budget is not that of the study, or of the call."""
    if content["kind"] != "plan":
        return []
    if "day" in content:
        stated = content["day"]["budget"]
        if costs.budget is None:
            return [f"the study has no budget; expected the one of {stated:g} beside it"]
        same = math.isclose(stated, costs.budget, rel_tol=1e-12)
        return [] if same else [f"the study has a budget of {costs.budget:g}, not of {stated:g}"]
    if costs.budget is None:
        return []
    # A plan may be judged beside all plans of its size, whatever these cost.
    made = content["experiments"]
    spent = costs.spent(Plan.from_dict({key: [row[key] for row in made] for key in made[0]}))
    if spent <= costs.budget * (1 + 1e-9):
        return []
    return [f"the study has a budget of {costs.budget:g}, and the plan costs {spent:g}"]


def _other_kept(content: dict[str, Any], keep: "Plan | None") -> list[str]:
    """How the experiments that a certificate takes as made are not those that were."""
    stated = content["kept"]
    if keep is None:
        message = "experiments are taken as made before; expected the plan of them beside the study"
        return [message] if stated else []
    same = len(stated) == len(keep.q) and all(
        np.allclose([row[key] for row in stated], own, rtol=1e-12, atol=1e-12)
        for key, own in (("q", keep.q), ("wrench", keep.wrench), ("repeats", keep.repeats))
    )
    return [] if same else ["the experiments taken as made before are not those beside it"]

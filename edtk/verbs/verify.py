"""`edtk.verify`: the claims of a certificate, recomputed."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from edtk.certificate.verification import Claim, Verification
from edtk.certificate.verify_certificate import verify_certificate
from edtk.certificate.verify_problem import verify_problem
from edtk.design.problem import Problem
from edtk.design.relaxation.store import CERTIFICATE
from edtk.system.errors import UserError
from edtk.system.parse_json import parse_json
from edtk.system.read_text import read_text

if TYPE_CHECKING:
    from edtk.study.study import Study
    from edtk.verbs.inputs import StudyLike

# A certificate has some hundred lines; one of 20,000 experiments has 20 MB. A larger file is
# rejected before it fills the memory.
MOST_MB = 50.0


def verify(
    certificate: Path | str | dict[str, Any], study: "StudyLike | Problem | None" = None
) -> Verification:
    """Recompute every claim of a certificate from its poses and multipliers alone.

    The check of a study's design shares no code with the search: it has a kinematics, an
    information matrix and bounds of its own, and draws the candidates anew. The certificate holds
    robot, load, noise and limits; whether these are the right ones, only the study can tell.

    The check of a `Problem` does share code: value and bound are recomputed from the candidates,
    weights and multipliers by the routine that proves bounds in the search. It finds what is wrong
    with a certificate, but no mistake in that routine. The result says so.

    Args:
        certificate: The file that `edtk.plan`, `edtk.relax` or `edtk.run` wrote, or its content.
        study: A study, or its file, whose setting the certificate must have; defaults to none, and
            then the certificate's own setting is taken as given. A certificate of a `Problem`, as
            `Relaxation.to_dict` makes it, needs that problem here.

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
    if isinstance(content, dict) and content.get("kind") == CERTIFICATE:
        return _of_problem(content, study, where)
    if not isinstance(content, dict) or "proof" not in content:
        raise UserError("not a certificate; expected a file written by --certificate", where=where)
    try:
        found = verify_certificate(content)
    except ValueError as error:
        raise UserError(f"not a certificate: {error}", where=where) from error
    if study is None:
        return found
    if isinstance(study, Problem):
        message = "this is a certificate of poses; expected a study beside it, not a problem"
        raise UserError(message, where=where)
    return replace(found, claims=(_same_study(content, study), *found.claims))


def _of_problem(content: dict[str, Any], problem: object, where: str) -> Verification:
    """Check a certificate of a problem of arrays."""
    if not isinstance(problem, Problem):
        raise UserError(
            "this is a certificate of a problem of arrays; expected that problem beside it, in "
            "Python: edtk.verify(certificate, problem)",
            where=where,
        )
    try:
        return verify_problem(content, problem)
    except ValueError as error:
        raise UserError(f"not a certificate: {error}", where=where) from error


def _other_costs(content: dict[str, Any], study: "Study") -> list[str]:
    """What a day costs, where that is not what the study says; the budget may be a call's own."""
    if "day" not in content:
        return []
    from edtk.calibration.geometry_design.day_costs import DayCosts

    costs = DayCosts.of(study) or DayCosts()
    expected = {
        "visit": costs.visit,
        "loaded_visit": costs.loaded_visit,
        "load_change": costs.change,
        "load_changes": costs.changes,
    }
    return [f"cost {key}" for key, value in expected.items() if content["day"].get(key) != value]


def _same_study(content: dict[str, Any], study: "StudyLike") -> Claim:
    """The claim that a certificate's robot, load, noise and limits are those of a study."""
    # Imported late: studies bring pydantic, which the check of a file alone need not pay.
    from edtk.verbs.inputs import as_study
    from edtk.verbs.setting_of import setting_of

    known = as_study(study)
    expected = json.loads(json.dumps(setting_of(known)))
    stated = content["setting"]
    keys = [*expected, *(key for key in stated if key not in expected)]
    other = [key for key in keys if stated.get(key) != expected.get(key)]
    other += _other_costs(content, known)
    reason = f"the study has another {', '.join(other)}" if other else ""
    return Claim("study", not other, None, None, reason)

"""The question of a study of geometry, in one paragraph."""

from edtk.calibration.geometry_design.geometry_designs import GeometryDesigns
from edtk.report.text.geometry_plan import about
from edtk.study.describe_noise import describe_noise
from edtk.study.study import Study


def setting_of_geometry(designs: GeometryDesigns) -> str:
    """What is unknown, what a visit measures under which loads, and what bounds the plans."""
    question = designs.question
    study = designs.study
    specification = study.specification
    told = f"{question.model.p} parameters can be told apart"
    if question.model.p < question.structural.p:
        told += f" of {question.structural.p} that any poses would tell"
    markers = len(question.model.markers)
    kind = "pose" if question.model.rows == "pose" else "position"
    parts = [
        f"unknown {_unknown(study)}: {told}",
        *about(question),
        _loads(designs),
        f"measured: {kind}s of {markers} marker{'' if markers == 1 else 's'}",
        f"{describe_noise(specification)}{margin_in_words(study)}",
        *_budget(designs),
    ]
    untold = "".join(f"\n- Not told by feasible poses: {words}.\n" for words in question.untold)
    return f"{'; '.join(parts)}.\n{untold}"


def margin_in_words(study: Study) -> str:
    """How far plans stay away from limits, as the end of a list; empty for no margin."""
    joints = study.specification.joints
    given = ((joints.margin_deg, "deg"), (joints.margin_mm, "mm"))
    margins = " and ".join(f"{margin:g} {unit}" for margin, unit in given if margin)
    return f"; plans stay {margins} away from the limits of the joints" if margins else ""


def _unknown(study: Study) -> str:
    """The groups of parameters."""
    asked = study.specification.parameters
    assert asked is not None
    geometry = "geometry" if asked.geometry == "all" else f"geometry ({', '.join(asked.geometry)})"
    springs = ", ".join(study.specification.joints.unknown)
    groups = {
        geometry: bool(asked.geometry),
        "base": asked.base,
        "tool": asked.tool,
        f"compliances of {springs}": bool(springs),
    }
    return ", ".join(name for name, wanted in groups.items() if wanted)


def _loads(designs: GeometryDesigns) -> str:
    """What visits may be loaded with."""
    if len(designs.question.wrenches) == 1:
        return "visits without a load"
    return f"visits without a load, or with {designs.study.specification.describe_load()}"


def _budget(designs: GeometryDesigns) -> list[str]:
    """What the budget of a day limits."""
    costs = designs.study.specification.costs
    if costs is None or costs.budget is None:
        return []
    limit = f"{costs.budget:g} {costs.unit}".rstrip()
    return [f"optimised plans cost {limit} at most, which bounds and random plans do not heed"]

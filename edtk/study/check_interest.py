"""The checks of a study's table `interest`."""

from typing import TYPE_CHECKING

import criteria
from edtk.model.geometry.all_parameters import all_parameters
from edtk.study.interest_table import InterestTable
from edtk.study.study_model import on_robot
from edtk.system.errors import UserError

if TYPE_CHECKING:
    from edtk.study.study import Study


def check_interest(study: "Study") -> None:
    """Check that what is of interest makes sense, and that the criteria can be about it.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    table = study.specification.interest
    if table is None:
        return
    if study.specification.parameters is not None:
        _check_parameters(study, table)
        return
    if table.parameters:
        message = "is for studies with [parameters]; expected joints or combinations"
        raise study.error("interest.parameters", message)
    _check_joints(study, "interest.joints", table.joints)
    for i, factors in enumerate(table.combinations):
        _check_joints(study, f"interest.combinations[{i + 1}]", tuple(factors))
        _check_units(study, f"interest.combinations[{i + 1}]", factors)
    assert study.interest is not None
    depends = False
    for key in ("optimise", "criteria"):
        for name in getattr(study.specification, key):
            if criteria.get(name).needs_target or not criteria.get(name).takes_interest:
                continue
            depends = True
            try:
                study.criterion(name)
            except UserError as error:
                whose = "interest" if error.message.startswith("interest") else key
                raise study.error(whose, error.message.removeprefix("interest: ")) from error
    if not depends:
        message = (
            "no criterion of the study depends on it, as the test pose says what these are about; "
            'expected another criterion too, such as optimise = ["D"]'
        )
        raise study.error("interest", message)


def _check_parameters(study: "Study", table: InterestTable) -> None:
    """Names of parameters, of which a study of geometry has more than compliances."""
    if table.joints or table.combinations:
        key = "interest.joints" if table.joints else "interest.combinations"
        raise study.error(
            key, "a study with [parameters] names what is of interest in `parameters`"
        )
    asked = study.specification.parameters
    assert asked is not None
    every = all_parameters(
        study.robot,
        tuple(name for _, name in on_robot(study)) or ("marker",),
        asked.geometry,
        study.specification.joints.unknown,
        asked.base,
        asked.tool,
    )
    for name in table.parameters:
        if not any(name in one.groups for one in every):
            known = ", ".join(dict.fromkeys(one.groups[-1] for one in every))
            raise study.error(
                "interest.parameters",
                f"no parameter {name!r} is asked for; expected some of {known}, of kinds, joints, "
                f"or single ones such as {every[-1].name}",
            )


def _check_joints(study: "Study", key: str, names: tuple[str, ...]) -> None:
    unknown = study.specification.joints.unknown
    for name in names:
        if name not in unknown:
            message = f"{name!r} is no unknown joint; expected {', '.join(unknown)}"
            raise study.error(key, message)


def _check_units(study: "Study", key: str, factors: dict[str, float]) -> None:
    """Compliances of joints that turn and of joints that slide are no numbers of one kind."""
    robot = study.robot
    kinds = {robot.joints[robot.joint_names.index(name)].kind for name, f in factors.items() if f}
    if len(kinds) > 1:
        raise study.error(
            key, "adds compliances of a revolute and of a prismatic joint; expected one unit"
        )

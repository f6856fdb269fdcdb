"""The checks of a study's table `interest`."""

from typing import TYPE_CHECKING

import criteria
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

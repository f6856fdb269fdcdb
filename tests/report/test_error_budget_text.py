"""What a terminal says of the parts of the expected error."""

from edtk.measure.expected_error import AssumedJoint, ErrorBudget, JointPart
from edtk.report.views.calibration import error_budget

JOINT = AssumedJoint("q1", 0, 0.0, 3e-7, "[simulation]")
BUDGET = ErrorBudget(
    noise=4e-6,
    model=0.0,
    load=2e-5,
    tool=0.0,
    rigid_joints=3e-4,
    known_joints=0.0,
    drift=0.0,
    repeatability=0.0,
    uncompensated=1e-3,
    joints=(JointPart(JOINT, 3e-4, told=5e-8),),
)


def test_parts_that_are_zero_are_not_listed() -> None:
    """The line of the parts has those that make some of the total."""
    assert "of it [mm]: noise 0.004, load 0.02, rigid joints 0.3\n" in error_budget(BUDGET)


def test_a_joint_is_to_be_listed_where_its_kind_of_study_lists_joints() -> None:
    """A study with [parameters] refuses a joint that only joints.unknown lists."""
    assert "list it in joints.unknown\n" in error_budget(BUDGET)
    assert "list it in parameters.compliance\n" in error_budget(BUDGET, of_visits=True)

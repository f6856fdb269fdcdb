"""Text of a study."""

from collections.abc import Sequence

from edtk.model.constraints.constraint import Constraint
from edtk.study.describe_measured import describe_measured
from edtk.study.describe_noise import describe_noise
from edtk.study.study import Study


def study(asked: Study) -> str:
    """The question: a line for each key that a person would ask about."""
    rows = study_rows(asked)
    width = max(len(name) for name, _ in rows)
    lines = [f"  {name:{width}}  {value}" for name, value in rows]
    return "\n".join([asked.specification.title, *lines])


def study_rows(asked: Study) -> list[tuple[str, str]]:
    """Names and values of the main keys, in words."""
    specification = asked.specification
    noise = describe_noise(specification)
    joints = specification.joints
    known = [
        f"{name} = {one.value:g} +- {one.deviation:g} rad/(N m)"
        for name, one in joints.known.items()
    ]
    fixed = [f"{name} = {value:g} deg" for name, value in joints.fixed_deg.items()]
    fixed += [f"{name} = {value:g} mm" for name, value in joints.fixed_mm.items()]
    labels = [label for c in _constraints(asked) for label in c.labels(asked.robot)]
    rows = [
        ("robot", f"{asked.robot.name}, {asked.robot.n} joints"),
        ("controller", _controller(asked)),
        ("unknown", ", ".join(joints.unknown)),
        ("of interest", ", ".join(asked.interest_names)),
        ("known", ", ".join(known)),
        ("prior", "counts in designs" if specification.prior.in_design else ""),
        ("fixed", ", ".join(fixed)),
        ("experiment", specification.describe_load()),
        ("measured", f"{describe_measured(asked)}, {noise}"),
        ("workspace", "; ".join(labels)),
        ("task", _task(asked)),
        ("optimised for", ", ".join(specification.optimise)),
        ("compared under", ", ".join(specification.criteria)),
        ("experiments", ", ".join(map(str, specification.sizes))),
        ("seed", str(specification.seed)),
    ]
    return [(name, value) for name, value in rows if value]


def _constraints(asked: Study) -> Sequence[Constraint]:
    """Constraints on the poses; plans to keep away from, too, where there are plans."""
    if asked.specification.parameters is not None:
        return asked.specification.workspace.build()
    return asked.space.workspace.constraints


def _controller(asked: Study) -> str:
    """How the controller counts otherwise than the model; empty if it does not."""
    robot = asked.robot
    controller = robot.controller
    if controller is None:
        return ""
    names = robot.joint_names
    turned = [name for name, sign in zip(names, controller.sign, strict=True) if sign < 0]
    zeros = [
        f"{joint.name} = {zero:g} {'mm' if joint.kind == 'prismatic' else 'deg'}"
        for joint, zero in zip(robot.joints, controller.zero, strict=True)
        if zero
    ]
    parts = [f"counts {', '.join(turned)} the other way round"] if turned else []
    parts += [f"shows {', '.join(zeros)} at the model's zero"] if zeros else []
    parts += [f"{names[one.joint]} follows {names[one.leader]}" for one in controller.follows]
    return "; ".join(parts)


def _task(asked: Study) -> str:
    """Where the robot shall be accurate; empty without a test pose."""
    tasks = asked.tasks
    if not tasks:
        return ""
    levers = sorted({1e3 * task.lever for task in tasks if task.lever})
    sizes = " or ".join(f"{size:g}" for size in levers)
    lever = f", rotations count as at {sizes} mm" if levers else ""
    path = asked.specification.task
    named = "" if path is None else f" of the path {path.file}"
    return f"{tasks.place.removeprefix('in ')}{named}{lever}"

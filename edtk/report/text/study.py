"""Text of a study."""

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
    measurement = specification.measurement
    noise = f"sigma = {measurement.sigma_mm:g} mm"
    if measurement.rows == "pose":
        noise += f" and {measurement.sigma_deg:g} deg"
    joints = specification.joints
    known = [f"{name} = {k:g} rad/(N m)" for name, k in joints.known_rad_per_Nm.items()]
    fixed = [f"{name} = {value:g} deg" for name, value in joints.fixed_deg.items()]
    fixed += [f"{name} = {value:g} mm" for name, value in joints.fixed_mm.items()]
    labels = [label for c in asked.space.workspace.constraints for label in c.labels(asked.robot)]
    rows = [
        ("robot", f"{asked.robot.name}, {asked.robot.n} joints"),
        ("unknown", ", ".join(joints.unknown)),
        ("of interest", ", ".join(asked.interest_names)),
        ("known", ", ".join(known)),
        ("fixed", ", ".join(fixed)),
        ("experiment", specification.describe_load()),
        ("measured", f"{measurement.rows}, {noise}"),
        ("workspace", "; ".join(labels)),
        ("task", _task(asked)),
        ("optimised for", ", ".join(specification.optimise)),
        ("compared under", ", ".join(specification.criteria)),
        ("experiments", ", ".join(map(str, specification.sizes))),
        ("seed", str(specification.seed)),
    ]
    return [(name, value) for name, value in rows if value]


def _task(asked: Study) -> str:
    """Where the robot shall be accurate; empty without a test pose."""
    task = asked.task
    if task is None:
        return ""
    lever = f", rotations count as at {1e3 * task.lever:g} mm" if task.lever else ""
    return f"{task.place.removeprefix('in ')}{lever}"

"""The pose designs on which the tests of this folder rest: the paper's, and an odd one."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from edtk.design import BoundedLoad, FixedLoad, FreeLoad, ListedLoad, PoseDesign
from edtk.design.log_cost import LogCost
from edtk.design.neighbourhood import Neighbourhood
from edtk.model import ElastostaticModel, Height, Joint, Robot, Tilt, Workspace, transform
from edtk.study import load_study

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
KR270 = STUDY.design


def odd() -> PoseDesign:
    """Prismatic joints among revolute ones on skew axes, forces and torques, six measured rows, a fixed joint."""
    rng = np.random.default_rng(3)
    kinds = ("revolute", "prismatic", "revolute", "revolute", "prismatic", "revolute")
    joints = tuple(
        Joint(f"q{i + 1}", transform(rng.normal(size=3), rng.uniform(-3, 3, size=3)), rng.normal(size=3), (-2, 2), kind)
        for i, kind in enumerate(kinds)
    )
    robot = Robot("odd", joints, transform([0.3, -0.2, 0.5], [0.4, -0.7, 1.1]), transform([0.2, 0.1, -0.3]))
    return PoseDesign(
        model=ElastostaticModel(robot, (0, 2, 3, 5), "pose"),
        workspace=Workspace(robot, (Height(-0.5), Tilt(1.2))),
        sigma=np.array([3e-5, 4e-5, 5e-5, 1e-4, 2e-4, 3e-4]),
        load=FixedLoad(np.array([300.0, -200.0, 500.0, 40.0, -70.0, 90.0])),
        free=[0, 1, 2, 4, 5],
        fixed=np.array([0.0, 0.0, 0.0, 0.7, 0.0, 0.0]),
    )


DESIGNS = {"kr270": KR270, "odd": odd()}


def loads(wrench) -> dict:
    """A load of each kind whose largest force is that of a wrench (6,)."""
    turned = np.concatenate([np.roll(wrench[:3], 1), np.roll(wrench[3:], 2)])
    return {
        "fixed": FixedLoad(wrench),
        "bounded": BoundedLoad(wrench),
        "listed": ListedLoad(np.array([wrench, turned, -0.3 * wrench])),
        "free": FreeLoad(float(np.linalg.norm(wrench[:3]))),
    }


LOADED = {
    f"{name} {kind}": replace(design, load=load)
    for name, design in DESIGNS.items()
    for kind, load in loads(design.load.always).items()
}


def log_cost_slope(design, criterion, x, repeats):
    """Log costs (b,) of plans x (b, k, v) with repetitions (b, k), and slopes (b, k, d) by the movable variables."""
    near = Neighbourhood(design, x)
    value, slope, _, _ = LogCost(criterion, repeats).local(near, np.arange(len(x)))
    return value, slope / near.span

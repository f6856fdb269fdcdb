"""The pose designs on which the tests of this folder rest: the paper's, and an odd one."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.design.interior_point.objective import Neighbourhood
from edtk.design.relaxation.settle import LogCost
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.tilt import Tilt
from edtk.robots.joint import Joint
from edtk.robots.loads.bounded_load import BoundedLoad
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.robots.workspace import Workspace
from edtk.study.study import load_study

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
KR270 = STUDY.space


def odd() -> DesignSpace:
    """A robot with prismatic joints and skew axes, six measured rows, torques, a fixed joint."""
    rng = np.random.default_rng(3)
    kinds = ("revolute", "prismatic", "revolute", "revolute", "prismatic", "revolute")
    joints = tuple(
        Joint(
            f"q{i + 1}",
            transform(rng.normal(size=3), rng.uniform(-3, 3, size=3)),
            rng.normal(size=3),
            (-2, 2),
            kind,
        )
        for i, kind in enumerate(kinds)
    )
    robot = Robot(
        "odd", joints, transform([0.3, -0.2, 0.5], [0.4, -0.7, 1.1]), transform([0.2, 0.1, -0.3])
    )
    return DesignSpace(
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
    f"{name} {kind}": replace(space, load=load)
    for name, space in DESIGNS.items()
    for kind, load in loads(space.load.always).items()
}


def log_cost_slope(space, criterion, x, repeats):
    """Log costs (b,) of plans x (b, k, v) with repetitions (b, k), and slopes (b, k, d)."""
    near = Neighbourhood(space, x)
    value, slope, _, _ = LogCost(criterion, repeats).local(near, np.arange(len(x)))
    return value, slope / near.span


def symmetric(q):
    """A pose (6,) of the KR 270, and seven others of the same information (vertical force)."""
    turn = 2 * np.pi * np.eye(6)
    flip = q * [1, 1, 1, 1, -1, 1] + np.pi * np.array([0, 0, 0, 1, 0, 1])
    mirror = [1, 1, 1, -1, 1, -1]
    return np.array(
        [
            q,
            q + turn[3],
            q - turn[5],
            q * mirror,
            flip,
            flip * mirror,
            flip - turn[3],
            q + np.eye(6)[0],
        ]
    )

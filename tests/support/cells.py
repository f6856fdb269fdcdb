"""A KR 270 between a table, a column and a floor, whose bodies are plain capsules."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from edtk.cell.cell import Cell, Clear, every_pair
from edtk.cell.shapes import Body, Box, Capsule, Cylinder, Plane
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.study.study import Study, load_study

STUDY = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"


def skeleton(robot: Robot, radius: float = 0.1) -> list[Body]:
    """A capsule for each body of an arm, from its joint to the next one."""
    count = len(robot.chain)
    frames = robot.frames(np.zeros(robot.n), range(count))
    places = [frames.bodies[j][1] for j in range(count)] + [frames.position]
    return [
        Body(
            f"link{j + 1}",
            j,
            (Capsule(np.zeros(3), frames.bodies[j][0] @ (places[j + 1] - places[j]), radius),),
        )
        for j in range(count)
    ]


def surroundings() -> list[Body]:
    """One body of each kind of shape that stands still."""
    turned = transform(position=[0.3, -1.5, 0.8], rpy=[0.3, 0.2, 0.9])
    table = Box(transform(position=[1.6, 0.2, 0.3]), np.array([0.4, 0.6, 0.3]))
    return [
        Body("table", None, (table,)),
        Body("column", None, (Cylinder(turned, 0.2, 0.9),)),
        Body("floor", None, (Plane(np.array([0.0, 0, 1]), 0.0),)),
        Body("rail", None, (Capsule(np.array([-1.0, 1, 2]), np.array([1.0, 1, 2]), 0.1),)),
    ]


def cell_of(robot: Robot, margin: float = 0.0, more: tuple[Body, ...] = ()) -> Cell:
    """The arm in its surroundings; its neighbouring bodies are not looked at."""
    bodies = [*skeleton(robot), *surroundings(), *more]
    return Cell(robot, tuple(bodies), margin, tuple(filter(_apart, every_pair(bodies))))


def _apart(pair: tuple[str, str]) -> bool:
    """Whether two bodies do not touch by their build."""
    links = [int(name[4:]) for name in pair if name.startswith("link")]
    if len(links) == 2:
        return abs(links[0] - links[1]) > 2
    return set(pair) != {"link1", "floor"}


BLOCK = Body("block", None, (Box(transform(position=[1.9, 0, 1.6]), np.full(3, 0.35)),))


def milling(margin: float = 0.02, more: tuple[Body, ...] = (), **keys: object) -> Study:
    """The milling study in that cell, with a block where the best poses would be."""
    study = load_study(STUDY).replace(candidates=300, starts=16, **keys)
    clear = Clear(cell_of(study.robot, margin, (BLOCK, *more)))
    study.__dict__["space"] = replace(study.space, clear=clear)
    return study

"""The capsules of arms against their meshes, by a collision library that shares nothing with edtk.

Pinocchio reads the URDF, places the links and builds their collision geometry; coal says where it
overlaps and how far parts are from each other. Run as

    python studies/bodies_against_meshes.py FOLDER [POSES]

with the folder `robots` of the package example-robot-data, and the number of random poses. It
writes studies/bodies_against_meshes.md.
"""

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from edtk.cell.cell import Cell
from edtk.cell.pairs import Pairs, pairs_to_look_at
from edtk.cell.robot_bodies import urdf_bodies
from edtk.robots.robot import Robot
from edtk.robots.urdf.load_urdf import load_urdf

ARMS = (
    ("UR10", "ur_description/urdf/ur10_robot.urdf", "ee_link"),
    ("Panda with its hand", "panda_description/urdf/panda.urdf", "panda_hand"),
    ("xArm7", "xarm_description/urdf/xarm7.urdf", None),
)
POSES = 100_000
MEASURED = 2_000  # poses in which all distances are measured
FAR = 0.060  # [m]
PAGE = Path(__file__).with_suffix(".md")


class Meshes:
    """The collision geometry of an arm, as pinocchio and coal have it."""

    def __init__(self, path: Path, robot: Robot, pairs: tuple[tuple[str, str], ...]) -> None:
        root = str(path.parents[3])
        self.model = pin.buildModelFromUrdf(str(path))
        self.geometry = pin.buildGeomFromUrdf(
            self.model, str(path), pin.GeometryType.COLLISION, package_dirs=[root, root + "/.."]
        )
        self.data = self.model.createData()
        of: dict[str, list[int]] = {}
        for index, one in enumerate(self.geometry.geometryObjects):
            of.setdefault(self.model.frames[one.parentFrame].name, []).append(index)
        self.pair_of = []
        for number, (first, second) in enumerate(pairs):
            for i in of[first]:
                for j in of[second]:
                    self.geometry.addCollisionPair(pin.CollisionPair(i, j))
                    self.pair_of.append(number)
        self.found = pin.GeometryData(self.geometry)
        self.pairs = len(pairs)
        names = [self.model.names[i] for i in range(1, self.model.njoints)]
        places = [self.model.joints[self.model.getJointId(name)].idx_q for name in names]
        self.q = pin.neutral(self.model)
        self.places = [places[names.index(name)] for name in robot.joint_names]

    def place(self, q: np.ndarray) -> None:
        """Move the arm."""
        self.q[self.places] = q
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.found, self.q)

    def overlap(self, q: np.ndarray) -> bool:
        """Whether any two meshes overlap."""
        self.place(q)
        return bool(pin.computeCollisions(self.geometry, self.found, True))

    def distances(self, q: np.ndarray) -> np.ndarray:
        """How far the bodies of each pair are apart [m]; negative where they overlap."""
        self.place(q)
        pin.computeDistances(self.geometry, self.found)
        each = np.full(self.pairs, np.inf)
        for number, result in zip(self.pair_of, self.found.distanceResults, strict=True):
            each[number] = min(each[number], result.min_distance)
        return each


@dataclass(frozen=True)
class Found:
    """What was counted of one arm."""

    name: str
    capsules: int
    pairs: Pairs
    free: int
    wrong: int
    apart: int
    refused: int
    far: int
    touching: int
    seconds: float

    @property
    def row(self) -> list[str]:
        """The cells of its row."""
        return [
            self.name,
            str(self.capsules),
            str(len(self.pairs.looked_at)),
            f"{self.free:,}",
            str(self.wrong),
            f"{self.far:,}",
            share(self.touching, self.far),
            f"{self.apart:,}",
            share(self.refused, self.apart),
            f"{self.seconds:.1f}",
        ]


COLUMNS = (
    "arm",
    "capsules",
    "pairs",
    "poses called free",
    "meshes overlap in",
    "pairs in poses over 60 mm apart",
    "of these called touching",
    "poses without overlap",
    "of these refused",
    "seconds to prepare",
)


def look_at(name: str, path: Path, tip: str | None, poses: int) -> Found:
    """Count for one arm."""
    begun = time.process_time()
    robot = load_urdf(path, tip=tip)
    bodies = urdf_bodies(path, tip=tip)
    pairs = pairs_to_look_at(robot, bodies, own={body.name for body in bodies})
    seconds = time.process_time() - begun
    cell = Cell(robot, bodies, 0.0, pairs.looked_at)
    every = (*pairs.looked_at, *pairs.always, *pairs.never)
    meshes = Meshes(path, robot, every)
    q = np.random.default_rng(0).uniform(*robot.limits, (poses, robot.n))
    free = cell.free(q)
    wrong = sum(meshes.overlap(one) for one in q[free])
    some = q[:MEASURED]
    apart = np.array([meshes.distances(one) for one in some])
    without = apart.min(axis=1) > 0
    far = apart[:, : len(pairs.looked_at)] > FAR
    return Found(
        name,
        sum(len(body.shapes) for body in bodies),
        pairs,
        int(free.sum()),
        wrong,
        int(without.sum()),
        int((without & ~free[:MEASURED]).sum()),
        int(far.sum()),
        int((far & (cell.distances(some) < 0)).sum()),
        seconds,
    )


def share(part: int, whole: int) -> str:
    """A part in percent."""
    return "-" if not whole else f"{100 * part / whole:.2f} %"


def page(found: list[Found], poses: int) -> str:
    """The page of numbers."""
    lines = [
        "# Capsules against meshes",
        "",
        f"Written by `{Path(__file__).name}`: {poses:,} random poses of each arm within its joint",
        "limits, no margin. Pinocchio reads the URDF and places its collision meshes, coal says",
        "where they overlap and how far apart they are. Poses called free are those of edtk, by",
        "capsules; any overlap of meshes counts, of all pairs but those that one joint connects.",
        f"Distances are those of the first {MEASURED:,} poses.",
        "",
        "| " + " | ".join(COLUMNS) + " |",
        "|" + "---|" * len(COLUMNS),
        *("| " + " | ".join(one.row) + " |" for one in found),
        "",
        "Pairs of parts that are not looked at although no single joint connects them, as their",
        "capsules touch here and there and their meshes never do:",
        "",
    ]
    for one in found:
        assert not one.pairs.always
        never = ", ".join(f"{first} and {second}" for first, second in one.pairs.never) or "none"
        lines.append(f"- {one.name}: {never}")
    return "\n".join(lines) + "\n"


def main(folder: str, poses: str = str(POSES)) -> None:
    """Count, and write the page."""
    found = [look_at(name, Path(folder) / file, tip, int(poses)) for name, file, tip in ARMS]
    for one in found:
        print(one)
    PAGE.write_text(page(found, int(poses)), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])

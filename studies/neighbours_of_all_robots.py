"""Neighbouring parts of all robots of example-robot-data, by edtk and by pinocchio.

Of each URDF the chain with the most joints is taken. Two parts are neighbours if one joint of the
chain lies between them; pinocchio says so of the model whose other joints are locked, by its own
tree of joints. Listed are, too, other parts whose capsules touch in every pose, and parts that pass
close by each other and whose meshes never touch. Run as

    python studies/neighbours_of_all_robots.py FOLDER

with the folder `robots` of the package. It writes studies/neighbours_of_all_robots.md.
"""

import sys
import time
from itertools import combinations
from pathlib import Path

import pinocchio as pin

from edtk.cell.pairs import pairs_to_look_at
from edtk.cell.robot_bodies import urdf_bodies
from edtk.robots.joint import ONE_TURN
from edtk.robots.robot import Robot
from edtk.robots.urdf.load_urdf import OpenLimitsError, load_urdf
from edtk.robots.urdf.parse_urdf import parse_urdf
from edtk.system.errors import UserError

METRE = (-1.0, 1.0)
PAGE = Path(__file__).with_suffix(".md")
COLUMNS = ("file", "tip", "joints", "parts", "neighbours", "as pinocchio", "always", "never", "s")


def longest(path: Path) -> str:
    """The link that the most joints move."""
    tree = parse_urdf(path.read_text(encoding="utf-8"))

    def moved_by(link: str) -> int:
        found = 0
        while link in tree.above:
            found += tree.above[link].kind not in ("fixed", "floating", "planar")
            link = tree.above[link].parent
        return found

    return max(tree.links, key=moved_by)


def robot_of(path: Path, tip: str) -> Robot:
    """The chain, whose open limits are a turn or a metre to either side."""
    try:
        return load_urdf(path, tip=tip)
    except OpenLimitsError as error:
        limits = {
            name: METRE if kind == "prismatic" else ONE_TURN for name, kind in error.joints.items()
        }
        return load_urdf(path, tip=tip, limits=limits)


def of_pinocchio(path: Path, robot: Robot) -> tuple[dict[str, int], list[int]]:
    """The joint that moves each link, and the joint before each joint, of the reduced model."""
    model = pin.buildModelFromUrdf(str(path))
    locked = [i for i in range(1, model.njoints) if model.names[i] not in robot.body_names]
    reduced = pin.buildReducedModel(model, locked, pin.neutral(model))
    links = {
        frame.name: frame.parentJoint
        for frame in reduced.frames
        if frame.type == pin.FrameType.BODY
    }
    return links, list(reduced.parents)


def look_at(path: Path) -> list[str]:
    """The cells of the row of one file, behind its name."""
    begun = time.process_time()
    tip = longest(path)
    robot = robot_of(path, tip)
    bodies = urdf_bodies(path, tip=tip)
    own = {body.name for body in bodies}
    found = pairs_to_look_at(robot, bodies, own=own)
    links, before = of_pinocchio(path, robot)
    theirs = {
        frozenset((a, b))
        for a, b in combinations(own, 2)
        if links[a] != links[b] and (before[links[a]] == links[b] or before[links[b]] == links[a])
    }
    same = theirs == {frozenset(pair) for pair in found.adjacent}
    return [
        tip,
        str(len(robot.chain)),
        str(len(bodies)),
        str(len(found.adjacent)),
        "yes" if same else "NO",
        ", ".join(f"{a} - {b}" for a, b in found.always) or "none",
        ", ".join(f"{a} - {b}" for a, b in found.never) or "none",
        f"{time.process_time() - begun:.1f}",
    ]


def main(given: str) -> None:
    """Compare all, and write the page."""
    folder = Path(given)
    rows, refused = [], []
    for path in sorted(folder.rglob("*.urdf")):
        name = str(path.relative_to(folder))
        try:
            rows.append([name, *look_at(path)])
        except ValueError as error:  # of edtk, or of pinocchio
            whose = "" if isinstance(error, UserError) else "pinocchio: "
            refused.append((name, whose + str(error).replace(str(folder), "...")))
            print(*refused[-1], flush=True)
        else:
            print(*rows[-1], flush=True)
    right = sum(row[5] == "yes" for row in rows)
    lines = [
        "# Neighbours of all robots",
        "",
        f"Written by `{Path(__file__).name}`: the longest chain of each URDF of the package.",
        f"Neighbours are as pinocchio has them in {right} of {len(rows)} chains.",
        "",
        "| " + " | ".join(COLUMNS) + " |",
        "|" + "---|" * len(COLUMNS),
        *("| " + " | ".join(row) + " |" for row in rows),
        "",
        f"{len(refused)} files are refused in a line, by edtk or by pinocchio:",
        "",
        *(f"- {name}: {said}" for name, said in refused),
    ]
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Do robots from URDF files move as pinocchio says?

    python -m pip install pin example-robot-data rtb-data    # beside edtk
    python studies/urdf_against_pinocchio.py [FOLDER ...] [--poses 1000]

Every chain from the root of a file to one of its leaves is compared with pinocchio, which reads the
same file with another parser: pose of the leaf and its Jacobian, in poses whose joints are drawn
evenly from -pi to pi, or from -1 m to 1 m. Without folders, all files of both packages are taken.
Differences of lengths are relative to the reach of the chain. Limits that a file leaves open are
given: they do not matter here. pinocchio takes tied joints (mimic) as free ones; their
values and columns are put together from what the file says of them. The table is in
urdf_against_pinocchio.md.
"""

import argparse
import importlib.metadata
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_file import RobotFileError
from edtk.robots.urdf.chain import chain
from edtk.robots.urdf.parse_urdf import LIMITED, parse_urdf
from edtk.system.files import read_text, write_text

PACKAGES = ("example-robot-data", "rtb-data")
ALLOWED = 1e-12
RECORD = """# URDF files against pinocchio

Written by `python studies/urdf_against_pinocchio.py`, which says what is compared.

{summary}

Largest differences in {poses} poses of each chain: of the pose of the leaf (lengths relative to the
reach of the chain, entries of the rotation) and of the Jacobian (likewise).

| file | chains | joints | tied | pose | Jacobian |
|-|-|-|-|-|-|
{rows}

## Refused

| file | why |
|-|-|
{refused}
"""


@dataclass
class Compared:
    """The chains of one file.

    Attributes:
        chains: Number of chains from the root to a leaf.
        joints: Numbers of joints of these chains.
        tied: Joints among them that follow others.
        pose: Largest difference of a leaf's pose.
        jacobian: Largest difference of its Jacobian.
        refused: What edtk says of the chains that it refuses, by leaf.
    """

    chains: int
    joints: list[int]
    tied: int
    pose: float
    jacobian: float
    refused: dict[str, str]


@dataclass
class Tie:
    """What a joint's value is made of: ``factor * (value of the joint root) + offset``."""

    root: str
    factor: float
    offset: float


def ties(path: Path) -> dict[str, Tie]:
    """The tie of each joint of a file, to itself where it is free."""
    direct = {}
    for joint in ET.parse(path).getroot().findall("joint"):
        mimic = joint.find("mimic")
        name = str(joint.get("name"))
        direct[name] = Tie(name, 1.0, 0.0)
        if mimic is not None:
            factor = float(mimic.get("multiplier", 1))
            direct[name] = Tie(str(mimic.get("joint")), factor, float(mimic.get("offset", 0)))
    return {name: _to_the_root(name, direct) for name in direct}


def _to_the_root(name: str, direct: dict[str, Tie]) -> Tie:
    # A tie to a joint that is not there ties nothing; edtk refuses such a chain.
    tie = direct.get(name, Tie(name, 1.0, 0.0))
    if tie.root == name:
        return tie
    master = _to_the_root(tie.root, direct)
    return Tie(master.root, tie.factor * master.factor, tie.factor * master.offset + tie.offset)


def leaves(path: Path) -> list[str]:
    """Links that carry no other link, and that a joint moves."""
    root = ET.parse(path).getroot()
    joints = root.findall("joint")
    above = {j.find("child").get("link"): j for j in joints}
    parents = {j.find("parent").get("link") for j in joints}
    ends = [str(link.get("name")) for link in root.findall("link")]

    def moves(link: str) -> bool:
        while link in above:
            if above[link].get("type") != "fixed":
                return True
            link = above[link].find("parent").get("link")
        return False

    return [link for link in ends if link not in parents and moves(link)]


def compare(path: Path, poses: int, seed: int = 0) -> Compared:
    """Compare all chains of a file.

    Raises:
        RobotFileError: edtk cannot read the file at all.
        Exception: pinocchio cannot.
    """
    import pinocchio as pin

    found = Compared(0, [], 0, 0.0, 0.0, {})
    robots: dict[str, Robot] = {}
    parse_urdf(read_text(path))
    names = ties(path)
    for leaf in leaves(path):
        try:
            robots[leaf] = _robot(path, leaf)
        except RobotFileError as error:
            found.refused[leaf] = error.message
    if not robots:
        return found
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    values = _values(model, names, poses, seed)
    ours = {leaf: _ours(robot, values) for leaf, robot in robots.items()}
    frames = {leaf: model.getFrameId(leaf, pin.FrameType.BODY) for leaf in robots}
    folds = {leaf: _fold(model, names, robot) for leaf, robot in robots.items()}
    for i in range(poses):
        q = _configuration(model, values, i)
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for leaf, robot in robots.items():
            T, J = ours[leaf]
            J_pin = pin.getFrameJacobian(model, data, frames[leaf], pin.LOCAL_WORLD_ALIGNED)
            T_pin = data.oMf[frames[leaf]].homogeneous
            lengths = np.array([1, 1, 1, robot.reach])
            found.pose = max(found.pose, (np.abs(T[i] - T_pin[:3]) / lengths).max())
            reach = np.array([robot.reach] * 3 + [1] * 3)[:, None]
            away = np.abs(J[i] - J_pin @ folds[leaf]) / reach
            found.jacobian = max(found.jacobian, away.max())
    found.chains = len(robots)
    found.joints = [robot.n for robot in robots.values()]
    found.tied = sum(len(robot.tied) for robot in robots.values())
    return found


def _robot(path: Path, leaf: str) -> Robot:
    """The chain to a leaf; limits of our own where those of the file are open or leave no range."""
    try:
        return load_robot(path, tip=leaf)
    except RobotFileError as error:
        if error.key != "limits":
            raise
    names = ties(path)
    free: dict[str, str] = {}
    for joint in chain(parse_urdf(read_text(path)), tip=leaf):
        root = names[joint.name].root
        if joint.kind in LIMITED:
            free[root] = root if joint.name == root else free.get(root, joint.name)
    return load_robot(path, tip=leaf, limits=dict.fromkeys(free.values(), (-3.0, 3.0)))


def _values(model, names: dict[str, Tie], poses: int, seed: int) -> dict[str, np.ndarray]:
    """Values (poses,) of all joints that move, in which the tied ones follow."""
    rng = np.random.default_rng(seed)
    drawn = {name: rng.uniform(-1, 1, size=poses) for name in names}
    for name in model.names[1:]:
        if "P" not in model.joints[model.getJointId(name)].shortname():
            drawn[name] *= np.pi
    return {
        name: tie.factor * drawn.get(tie.root, np.zeros(poses)) + tie.offset
        for name, tie in names.items()
    }


def _configuration(model, values: dict[str, np.ndarray], i: int) -> np.ndarray:
    """The i-th pose as pinocchio has it: cosine and sine of joints without limits."""
    q = np.empty(model.nq)
    for name in model.names[1:]:
        joint = model.joints[model.getJointId(name)]
        value = values[name][i]
        own = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        q[joint.idx_q : joint.idx_q + joint.nq] = own
    return q


def _ours(robot: Robot, values: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Poses of the leaf, without the last row, and Jacobians."""
    q = np.stack([values[name] for name in robot.joint_names], axis=-1)
    return robot.forward(q)[..., :3, :], robot.jacobian(q)


def _fold(model, names: dict[str, Tie], robot: Robot) -> np.ndarray:
    """Derivatives (nv, n) of pinocchio's joint values by edtk's: a tied joint follows."""
    fold = np.zeros((model.nv, robot.n))
    for j, own in enumerate(robot.joint_names):
        for name in model.names[1:]:
            if names[name].root == names[own].root:
                row = model.joints[model.getJointId(name)].idx_v
                fold[row, j] = names[name].factor / names[own].factor
    return fold


def files(folders: list[Path]) -> Iterator[Path]:
    """All URDF files of the folders, or without folders of both packages."""
    if not folders:
        for package in PACKAGES:
            listed = importlib.metadata.files(package) or []
            yield from sorted(Path(file.locate()) for file in listed if file.suffix == ".urdf")
    for folder in folders:
        yield from sorted(folder.rglob("*.urdf"))


def main() -> None:
    """Compare all files and write the table."""
    parser = argparse.ArgumentParser(description="Compare robots from URDF files with pinocchio.")
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--poses", type=int, default=1000)
    given = parser.parse_args()
    rows = []
    refused = []
    every = []
    for path in files(given.folders):
        try:
            found = compare(path, given.poses)
        except RobotFileError as error:
            refused.append((path.name, error.message))
            continue
        refused += [(f"{path.name}, {leaf}", why) for leaf, why in found.refused.items()]
        if not found.chains:
            refused.append((path.name, "no joint moves a link"))
            continue
        every.append(found)
        few, many = min(found.joints), max(found.joints)
        joints = f"{few}" if few == many else f"{few} to {many}"
        cells = (path.name, found.chains, joints, found.tied)
        rows.append((*cells, f"{found.pose:.1e}", f"{found.jacobian:.1e}"))
        print(*rows[-1], flush=True)
    worst = max(max(found.pose, found.jacobian) for found in every)
    summary = (
        f"{len(every)} files with {sum(found.chains for found in every)} chains are read; the "
        f"largest difference is {worst:.1e}, where {ALLOWED:g} is allowed."
    )
    text = RECORD.format(
        summary=summary, poses=given.poses, rows=_table(rows), refused=_table(refused)
    )
    write_text(Path(__file__).with_suffix(".md"), text)
    print(summary)


def _table(rows: list[tuple]) -> str:
    """Rows of a Markdown table."""
    return "\n".join(f"| {' | '.join(map(str, row))} |" for row in rows)


if __name__ == "__main__":
    main()

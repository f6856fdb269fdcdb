"""The plans of a run as files."""

import re
from collections.abc import Iterable
from pathlib import Path

from edtk.model.robot import Robot
from edtk.study.case import Case

KINDS = ("optimised", "distinct", "random")
NAME = re.compile(rf"({'|'.join(KINDS)})_(.+_)?m\d+(_k\d+)?")  # of a file that a run has written


def write_plans(cases: Iterable[Case], robot: Robot, folder: Path) -> None:
    """Write every plan that a run has made, and remove those of earlier runs.

    Args:
        cases: The cases of the run; published plans have files of their own.
        robot: The robot, which names the columns.
        folder: Folder of the files; files with other names than a run gives stay as they are.
    """
    wanted = {
        f"{case.name}.csv": case.plan
        for case in cases
        if case.plan is not None and case.kind in KINDS
    }
    for name, plan in wanted.items():
        plan.to_csv(folder / name, robot)
    for path in folder.glob("*.csv"):
        if path.name not in wanted and NAME.fullmatch(path.stem):
            path.unlink()

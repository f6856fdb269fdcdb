"""Small folders of valid inputs, from which every case begins."""

import contextlib
import io
import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

import edtk
from edtk.cli import main
from tests.fuzz import arm_worlds as arms
from tests.fuzz import cell_world, days_world, geometry_world, mix_world, poses_world

Files = dict[str, bytes]

# Study, robot, plan, task and excluded poses.
WRITTEN = {
    "arm": (arms.ARM, arms.ROBOT, arms.PLAN, arms.TASK, arms.EXCLUDE),
    "pose": (arms.POSE, arms.ROBOT, arms.PLAN, arms.TASK, arms.EXCLUDE),
    "rail": (arms.RAIL, arms.RAIL_ROBOT, arms.RAIL_PLAN, arms.RAIL_TASK, arms.RAIL_EXCLUDE),
    "cell": (
        cell_world.STUDY,
        cell_world.URDF,
        cell_world.PLAN,
        cell_world.TASK,
        cell_world.EXCLUDE,
    ),
}
GEOMETRY = "geometry"  # absolute positions, without a load
MIX = "mix"  # positions, a pose and distances in one study
FULL_POSES = "full poses"  # absolute poses, loaded or not: geometry and springs
DAYS = "days"  # springs from the nominal robot, with costs of a day, and robot programs
WORLDS = (*WRITTEN, GEOMETRY, MIX, FULL_POSES, DAYS)
FIRST = "arm"
ANY = "cell"  # any robot and any task: a URDF, markers, a payload, noise
EXACT = ("--size", "2", "--prove", "20", "--certificate", "exact.json")
OF_TABLES = ("arm", "pose", "rail")  # robots are in TOML files there
NAMES = ("study.toml", "robot.toml", "plan.csv", "task.csv", "exclude.csv")


def world(name: str) -> Files:
    """The files of a world by their names: those written above, and those that edtk makes of them.

    The first world has a finished run in the folder `run`, and a chain.
    """
    texts = _texts(name)
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for file, text in texts.items():
                Path(file).write_text(text.lstrip(), encoding="utf-8")
            _make(name)
            found = {
                str(path): path.read_bytes()
                for path in sorted(Path().rglob("*"))
                if path.is_file() and path.suffix != ".png"
            }
        finally:
            os.chdir(here)
    return found


def _texts(name: str) -> dict[str, str]:
    """The files of a world that are written above."""
    if name == GEOMETRY:
        return {"study.toml": geometry_world.STUDY, "robot.toml": arms.ROBOT, "plan.csv": arms.PLAN}
    if name == FULL_POSES:
        return poses_world.FILES
    own = {
        **WRITTEN,
        MIX: (mix_world.STUDY, *WRITTEN[FIRST][1:]),
        DAYS: (
            days_world.STUDY,
            days_world.ROBOT,
            days_world.PLAN,
            days_world.TASK,
            days_world.EXCLUDE,
        ),
    }
    written = dict(zip(NAMES, own[name], strict=True))
    if name == ANY:
        written["robot.urdf"] = written.pop("robot.toml")
    texts = {**written, "pub.csv": written["plan.csv"]}
    texts["earlier.json"] = arms.EARLIER
    if name == DAYS:
        texts.update(days_world.PROGRAMS)
    # One experiment that was made, so that there is another one to plan.
    texts["keep.csv"] = "\n".join(written["plan.csv"].splitlines()[:2]) + "\n"
    return texts


def _make(name: str) -> None:
    """Make the other files of a world."""
    if name == GEOMETRY:
        geometry_world.calibrate()
        _edtk("plan", "study.toml", "--budget", "1", "--certificate", "day.json")
        return
    if name == FULL_POSES:
        poses_world.calibrate()
        return
    _calibrate(mix_world.fill if name == MIX else _fill)
    _edtk("relax", "study.toml", "--certificate", "certificate.json")
    if name == FIRST:
        _search()
    if name == DAYS:
        _edtk("plan", "study.toml", "--budget", "1", "--certificate", "day.json")
        _edtk("plan", "study.toml", *EXACT)
    if name == ANY:
        _measure_positions()


def _calibrate(fill: Callable[[Path], None]) -> None:
    """Make a filled-in sheet and k.json."""
    _edtk("template", "study.toml", "plan.csv", "--out", "sheet.csv")
    fill(Path("sheet.csv"))
    found = edtk.identify("study.toml", "sheet.csv")
    Path("k.json").write_text(json.dumps(found.to_dict(), indent=2), encoding="utf-8")


def _search() -> None:
    """Make a run with its checkpoint, the certificate of a plan, and a chain."""
    _edtk("run", "study.toml", "--workers", "1", "--out", "run")
    planned = sorted(Path("run/certificates").glob("optimised_*.json"))
    Path("planned.json").write_bytes(planned[0].read_bytes())
    _edtk("bayes", "study.toml", "plan.csv", "--accuracy", "0.5", "--chain", "chain.h5")


def _fill(path: Path) -> None:
    """Write the deflections of the simulated robot into an empty sheet, with some noise."""
    study = edtk.load_study("study.toml")
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    A = study.model.regressor(*_poses(study, [header, *lines]))
    true = A @ study.compliances
    # A row of the sheet is one marker of a visit, whose markers stand one after another.
    own = len(study.specification.marker) or 1
    true = true.reshape(len(lines), own, -1)[np.arange(len(lines)), np.arange(len(lines)) % own]
    sigma = 1e-4 if study.specification.noise is None else 3e-5
    noisy = true + np.random.default_rng(0).normal(0, sigma, true.shape)
    printed = noisy * np.array([1e3] * 3 + [180 / np.pi] * 3)[: true.shape[1]]
    filled = [
        ",".join([line.rstrip(","), *(f"{number:.4f}" for number in row)])
        for line, row in zip(lines, printed, strict=True)
    ]
    path.write_text("\n".join([header, *filled]) + "\n", encoding="utf-8")


def _poses(study: edtk.Study, sheet: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Joint variables and wrenches of the lines of a sheet, each as a plan of its own."""
    columns = study.robot.n + 6
    found = []
    for line in sheet[1:]:
        Path("pose.csv").write_text(
            "\n".join(",".join(row.split(",")[:columns]) for row in (sheet[0], line)) + "\n",
            encoding="utf-8",
        )
        found.append(study.load_plan("pose.csv"))
    Path("pose.csv").unlink()
    return np.concatenate([p.q for p in found]), np.concatenate([p.wrench for p in found])


def _measure_positions() -> None:
    """Make a file of measured positions of a marker, for `edtk controller`."""
    study = edtk.load_study("study.toml")
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 0.5, (8, study.robot.n))
    where = 1e3 * study.robot.forward(q)[:, :3, 3]
    rows = np.concatenate([np.rad2deg(q), where], axis=1)
    header = "turn_deg,lift_deg,bend_deg,x_mm,y_mm,z_mm"
    text = "\n".join([header, *(",".join(f"{cell:.4f}" for cell in row) for row in rows)])
    Path("positions.csv").write_text(text + "\n", encoding="utf-8")


def _edtk(*arguments: str) -> None:
    """Run a command that has to succeed, in silence."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            main(list(arguments))
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"{arguments}: {said.getvalue()}") from end

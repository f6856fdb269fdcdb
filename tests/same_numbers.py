"""The numbers of the commands, recorded before a change of the house and compared after it.

    python tests/same_numbers.py record FOLDER [--inputs OTHER] [--data DIR]
    python tests/same_numbers.py compare BEFORE AFTER

`record` runs some eighty commands over the shipped studies, the how-to's study of geometry and
simulated sheets, and keeps what they print as JSON. With `--inputs` it takes the sheets and plans
of another record, so that only the commands may differ. `--data` adds three robots that others have
measured, whose files are not part of this repository. `compare` prints for each command by how much
its numbers differ, relative to the largest of their table, and names what is there only once.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd

import edtk

ROOT = Path(__file__).parents[1]
STUDIES = ROOT / "studies"
DISPLACEMENTS = {
    "milling": "",
    "tracker": (
        "[noise]\ntracker_position_mm = [4000, -3500, 1200]\nalong = [10, 0.5]\nacross = [15, 6]\n"
    ),
    "moving": "[noise]\nrepeatability_deg = 0.002\n",
    "prior": (
        '[prior.joints]\nq2 = { kind = "log-normal", median_rad_per_Nm = 5e-7, factor = 1.5 }\n'
    ),
}
PASSING = ("seconds", "study_sha256")  # which differ from run to run, and from file to file
ENDS = (".toml", "_plan.csv", "_day.csv")
SIX = ("kr270_six_compliances", "kr270_slot", "spherical_arm")
GEOMETRY = """
robot = "kuka_kr270"
candidates = 1000
starts = 8
[parameters]
compliance = {springs}
geometry = {geometry}
base = true
tool = true
[measurement]
sigma_mm = 0.05
{extra}
[load]
list_F_N = [[0, 0, 0], [0, 0, -2500]]
[test_pose]
q_deg = [0, -56.9, 89.3, 45.1, 76, 57.2]
load = {{ F_N = [0, 280, -180] }}
[simulation]
compliance_rad_per_Nm = {{ q2 = 3e-7, q3 = 4e-7, q4 = 2.8e-6, q5 = 2.8e-6, q6 = 2.1e-6 }}
[[marker]]
name = "A"
position_mm = [100, 0, 50]
[[marker]]
name = "B"
position_mm = [-50, 80, 60]
[[marker]]
name = "C"
position_mm = [0, -70, 90]
"""
GEOMETRIES = {
    "geometry": ("[]", '"all"', ""),
    "zeros": ('["q2", "q3"]', '"zeros"', ""),
    "springs": ('["q2", "q3", "q4", "q5", "q6"]', '"all"', "[noise]\nrepeatability_deg = 0.002\n"),
    "day": (
        '["q2", "q3"]',
        '"zeros"',
        "[costs]\nvisit = 1.5\nloaded_visit = 2\nload_change = 30\nbudget = 120\n",
    ),
}


@click.group()
def main() -> None:
    """Record numbers, or compare two records."""


@main.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--inputs", type=click.Path(exists=True, path_type=Path))
@click.option("--data", type=click.Path(exists=True, path_type=Path))
@click.option("--only", default="", help="Commands whose name has this in it.")
def record(folder: Path, inputs: Path | None, data: Path | None, only: str) -> None:
    """Run all commands, and keep what they print."""
    folder.mkdir(parents=True, exist_ok=True)
    if inputs is None:
        write_studies(folder)
    else:
        shutil.copytree(inputs / "inputs", folder / "inputs", dirs_exist_ok=True)
    commands = displacements(folder) | geometry(folder) | measured(data, folder)
    for name, words in commands.items():
        if only in name:
            if words and words[0] == "simulate":
                if inputs is None:
                    simulate(*words[1:])
                continue
            print(name, flush=True)
            run(folder, name, words)


def run(folder: Path, name: str, words: list[str]) -> None:
    """One command: its output, or its exit code and its complaint."""
    done = subprocess.run(
        [sys.executable, "-m", "edtk", *words], capture_output=True, text=True, check=False
    )
    text = done.stdout if done.returncode == 0 else json.dumps([done.returncode, done.stderr])
    (folder / f"{name}.json").write_text(text, encoding="utf-8")


def write_studies(folder: Path) -> None:
    """The studies that are no files of the repository."""
    at = folder / "inputs"
    at.mkdir(exist_ok=True)
    for robots in ("robots", "paths"):
        shutil.copytree(STUDIES / robots, at / robots, dirs_exist_ok=True)
    text = (STUDIES / "kr270_milling.toml").read_text(encoding="utf-8")
    for name, extra in DISPLACEMENTS.items():
        (at / f"{name}.toml").write_text(f"{text}\n{extra}", encoding="utf-8")
    for name in SIX:
        shutil.copy(STUDIES / f"{name}.toml", at / f"{name}.toml")
    for name, (springs, asked, extra) in GEOMETRIES.items():
        keys = {"springs": springs, "geometry": asked, "extra": extra}
        (at / f"{name}.toml").write_text(GEOMETRY.format(**keys), encoding="utf-8")


def displacements(folder: Path) -> dict[str, list[str]]:
    """Commands of studies of compliances, in the order in which they need each other."""
    commands: dict[str, list[str]] = {}
    for name in (*DISPLACEMENTS, *SIX):
        at = folder / "inputs"
        study, plan, sheet = (str(at / f"{name}{end}") for end in ENDS)
        proof = str(folder / f"{name}_proof.json")
        k = str(folder / f"{name}_identify.json")
        fixed = ["--seed", "1", "--json"]
        size = "4" if name != "spherical_arm" else "3"
        commands |= {
            f"{name}_input": ["simulate", study, plan, sheet, size],
            f"{name}_plan": ["plan", study, "--size", size, *fixed, "--workers", "1"],
            f"{name}_plan_d": ["plan", study, "--size", "6", "--criterion", "D", *fixed],
            f"{name}_relax": ["relax", study, *fixed, "--certificate", proof],
            f"{name}_relax_a": ["relax", study, "--criterion", "A", "--candidates", "2000", *fixed],
            f"{name}_verify": ["verify", proof, "--study", study, "--json"],
            f"{name}_evaluate": ["evaluate", study, plan, "--json"],
            f"{name}_template": ["template", study, plan],
            f"{name}_identify": ["identify", study, sheet, "--json"],
            f"{name}_robust": ["identify", study, sheet, "--robust", "--json"],
            f"{name}_linear": ["identify", study, sheet, "--linear", "--plan", plan, "--json"],
            f"{name}_compensate": ["compensate", study, k, "--json"],
            f"{name}_bias": ["bias", study, plan, "--json"],
        }
    return commands


def geometry(folder: Path) -> dict[str, list[str]]:
    """Commands of studies with [parameters]."""
    commands: dict[str, list[str]] = {}
    for name in GEOMETRIES:
        at = folder / "inputs"
        study, plan, sheet = (str(at / f"{name}{end}") for end in ENDS)
        result = str(folder / f"{name}_identify.json")
        fixed = ["--seed", "1", "--json"]
        commands |= {
            f"{name}_input": ["simulate", study, plan, sheet, "24"],
            f"{name}_plan": ["plan", study, "--size", "24", "--workers", "1", *fixed],
            f"{name}_relax": ["relax", study, *fixed],
            f"{name}_evaluate": ["evaluate", study, plan, "--json"],
            f"{name}_template": ["template", study, plan],
            f"{name}_identify": ["identify", study, sheet, "--json"],
            f"{name}_robust": ["identify", study, sheet, "--robust", "--json"],
            f"{name}_predict": ["predict", study, result, plan, "--json"],
            f"{name}_compensate": ["compensate", study, result, "--json"],
        }
    return commands


def measured(data: Path | None, folder: Path) -> dict[str, list[str]]:
    """Commands of robots that others have measured."""
    if data is None:
        return {}
    sys.path.insert(0, str(STUDIES))
    from measured_robots import FANUC, IRB_120, study_of

    commands: dict[str, list[str]] = {}
    base = ("base1", "base2", "base3")
    sets = {
        "irb": (IRB_120, (), "abb_irb120_calibration.csv"),
        "fanuc": (FANUC, (), "fanuc_r2000ic_165f.csv"),
        "irb_tracker": (IRB_120, base, "abb_irb120_tracker.csv"),
    }
    for name, (drawing, references, file) in sets.items():
        path = folder / "inputs" / f"{name}.toml"
        study_of(drawing, references).to_toml(path)
        result = str(folder / f"{name}_identify.json")
        commands |= {
            f"{name}_identify": ["identify", str(path), str(data / file), "--json"],
            f"{name}_predict": ["predict", str(path), result, str(data / file), "--json"],
        }
    return commands


def simulate(study: str, plan: str, sheet: str, size: str) -> None:
    """A plan at random, and the sheet of a day with errors of fixed seeds."""
    asked = edtk.load_study(study)
    rng = np.random.default_rng(11)
    if asked.specification.parameters is None:
        found = edtk.plan(asked, size=int(size), seed=2, workers=1).plan
        found.to_csv(plan, asked.robot)
        table = edtk.template(asked, found)
        k = 1e-6 * np.linspace(0.3, 3.0, asked.model.p)
        rows = asked.model.regressor(found.q, found.wrench) @ k
        rows = np.repeat(rows, found.repeats, axis=0)
        table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * (rows + rng.normal(0, 3e-5, rows.shape))
        table.to_csv(sheet, index=False)
        return
    q = np.round(rng.uniform(*np.rad2deg(asked.robot.limits), (int(size), asked.robot.n)), 3)
    wrench = np.zeros((int(size), 6))
    if asked.specification.joints.unknown:
        wrench[::2, 2] = -2500
    problem = edtk.geometry_problem(asked, np.deg2rad(q), wrench)
    model = problem.model
    theta = np.array([_error(rng, one.place) for one in model.parameters]) * model.scales
    torque = None if problem.loads is None else problem.loads(np.deg2rad(q), wrench)
    x = 1e3 * model.see(theta, np.deg2rad(q), torque, derivatives=False).points
    x = x + rng.normal(0, 0.05, x.shape)
    poses = pd.DataFrame(q, columns=[f"q{i}_deg" for i in range(1, 7)])
    forces = pd.DataFrame(wrench[:, :3], columns=["Fx_N", "Fy_N", "Fz_N"])
    seen = pd.DataFrame(x.reshape(len(q), -1), columns=[f"{m}{a}_mm" for m in "ABC" for a in "xyz"])
    pd.concat([poses, forces], axis=1).to_csv(plan, index=False)
    pd.concat([poses, forces, seen], axis=1).to_csv(sheet, index=False)


def _error(rng: np.random.Generator, place: str) -> float:
    """The true error of a parameter, in its own units."""
    return rng.uniform(0.3, 3.0) if place == "compliance" else rng.normal(0, 0.5)


@main.command()
@click.argument("before", type=click.Path(exists=True, path_type=Path))
@click.argument("after", type=click.Path(exists=True, path_type=Path))
@click.option("--most", default=1e-10, help="Relative difference that is named.")
def compare(before: Path, after: Path, most: float) -> None:
    """Say how much the numbers of two records differ."""
    worst = 0.0
    for path in sorted(before.glob("*.json")):
        other = after / path.name
        if not other.is_file():
            print(f"{path.stem}: only before")
            continue
        size, where = difference(_read(path), _read(other))
        worst = max(worst, size)
        if size > most:
            print(f"{path.stem}: {size:.1e} at {where}")
    print(f"largest: {worst:.1e}")


def _read(path: Path) -> Any:
    text = path.read_text(encoding="utf-8")
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text.split("\n")


def difference(one: Any, other: Any, key: str = "") -> tuple[float, str]:
    """The largest difference of two trees of plain data, and its key."""
    if isinstance(one, dict) and isinstance(other, dict):
        one = {name: value for name, value in one.items() if name not in PASSING}
        gone = sorted(one.keys() - other.keys())
        if gone:
            return np.inf, f"{key}: {gone[0]} is gone"
        pairs = [(one[name], other[name], f"{key}.{name}") for name in one]
    elif isinstance(one, list) and isinstance(other, list):
        if len(one) != len(other):
            return np.inf, f"{key}: {len(one)} and {len(other)}"
        numbers = np.array([one, other]) if one and all(map(_number, [*one, *other])) else None
        if numbers is not None:
            gap = float(np.abs(numbers[0] - numbers[1]).max())
            return gap / max(float(np.abs(numbers).max()), 1e-300), key
        pairs = [(a, b, f"{key}[{i}]") for i, (a, b) in enumerate(zip(one, other, strict=True))]
    elif _number(one) and _number(other):
        return abs(one - other) / max(abs(one), abs(other), 1e-300), key
    else:
        return (0.0 if one == other else np.inf), key
    return max((difference(*pair) for pair in pairs), default=(0.0, key))


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


if __name__ == "__main__":
    main()

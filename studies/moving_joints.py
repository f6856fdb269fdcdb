"""Joints that do not return exactly move all markers together: coverage, alarms, and estimates.

The truth is the loaded equilibrium; three markers are measured in each visit of 12 random poses,
new ones for each set. The tracker errs by 5 um in each coordinate of a displacement, and joints by
so much that markers move by 50 um, root mean square.

    python studies/moving_joints.py [runs]
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from fault_robots import robots
from threadpoolctl import threadpool_limits

from edtk import Study
from edtk.design.candidate_source import sample_feasible
from edtk.findings.fitted_data import FittedData
from edtk.findings.moving_joints import joint_unit
from edtk.findings.noise import cause_findings
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.identify import Identification, identify
from edtk.fit.measurements import Measurements, joint_motion
from edtk.fit.noise import visit_covariance
from edtk.measure.instruments.marker import Marker
from edtk.measure.task import all_compliances
from edtk.report.tables import markdown_table
from edtk.robots.frames import BodyPoint
from edtk.system.typing import Array

POSES = 12
TRACKER = 5e-6  # [m]
MOVED = 50e-6  # [m]
MARKERS = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.05], [0.0, -0.2, 0.1]])
CASES = ((3, True), (1, True), (3, False), (1, False))  # visits of a pose, and whether joints move
RUNS = 300
SEED = 2027
UNLIKELY = 0.01

# What is asked [%], the first two within chance.
COVERAGE = (93.0, 97.0)
MOST_FALSE = 2.0
LEAST_SEEN = 95.0
ERRORS = 2.0


@dataclass(frozen=True)
class Shares:
    """What so many simulated calibrations of one robot show.

    Attributes:
        robot: Its name.
        visits: Visits of each pose.
        moving: Whether joints move.
        runs: Number of calibrations.
        right: Shares of the 95 % intervals that cover the truth, for each compliance, where the
            noise is stated as it is [%].
        alarms: Share of these fits with p < 0.01 [%].
        white: Coverage where white noise is stated, and nothing else is done [%].
        told: Coverage where white noise is stated, and edtk tells the parts [%].
        seen: Share of these sets in which moving joints are named [%].
        blamed: Share of these sets in which any other fault is named [%].
        repeatability: Estimates over the truth, mean and standard deviation.
        tracker: The same of the tracker's noise.
    """

    robot: str
    visits: int
    moving: bool
    runs: int
    right: tuple[float, ...]
    alarms: float
    white: float
    told: float
    seen: float
    blamed: float
    repeatability: tuple[float, float]
    tracker: tuple[float, float]

    @property
    def holds(self) -> bool:
        """Whether coverage, alarms and names are as asked, within chance."""
        chance = ERRORS * 100 * np.sqrt(MOST_FALSE / 100 / self.runs)
        covered = COVERAGE[0] <= np.mean(self.right) <= COVERAGE[1]
        named = self.seen >= LEAST_SEEN if self.moving else self.seen <= 1.0 + chance
        return bool(covered and named and max(self.alarms, self.blamed) <= MOST_FALSE + chance)


def run_case(name: str, visits: int, moving: bool, runs: int) -> Shares:
    """Simulate calibrations of one robot."""
    study = robots()[name]
    truth = study.compliances
    joints = _joint_error(name)
    rows = []
    with threadpool_limits(1):
        for number in range(runs):
            stated = _measured(study, visits, joints if moving else 0.0, number)
            right = FittedData.of(study, stated).fit
            white = replace(stated, covariance=None, tracker=None, sigma=stated.tracker)
            told = FittedData.of(study, white)
            plain = identify(told.A, told.measured, white.sigma, right.parameters)
            kinds = [one.kind for one in cause_findings(told)]
            noise = told.noise_estimate
            rows.append(
                [
                    *_covered(right, truth),
                    right.p_value < UNLIKELY,
                    _covered(plain, truth).mean(),
                    _covered(told.fit, truth).mean(),
                    "moving_joints" in kinds,
                    "cause" in kinds,
                    np.deg2rad(noise.joints) / joints,
                    noise.tracker,
                ]
            )
    mean = np.mean(np.array(rows, dtype=float), axis=0)
    std = np.std(np.array(rows, dtype=float), axis=0)
    p = len(truth)
    return Shares(
        robot=name,
        visits=visits,
        moving=moving,
        runs=runs,
        right=tuple((100 * mean[:p]).tolist()),
        alarms=100 * mean[p],
        white=100 * mean[p + 1],
        told=100 * mean[p + 2],
        seen=100 * mean[p + 3],
        blamed=100 * mean[p + 4],
        repeatability=(mean[p + 5], std[p + 5]),
        tracker=(mean[p + 6], std[p + 6]),
    )


def _covered(fit: Identification, truth: Array) -> Array:
    """Which 95 % intervals (p,) hold the truth."""
    return np.abs(fit.unbounded - truth) <= fit.half_interval


@cache
def _joint_error(name: str) -> float:
    """Standard deviation of each joint in one reading, by which markers move by MOVED [rad]."""
    study = robots()[name]
    data = _poses(study, 1, 0)
    motion = joint_motion(study.model, data) * (joint_unit(study) * np.rad2deg(1.0))
    return MOVED / float(np.sqrt(np.mean((motion**2).sum(axis=-1))))


def _poses(study: Study, visits: int, number: int) -> Measurements:
    """Random feasible poses, each visited so many times, with three markers."""
    space = study.space
    x = sample_feasible(space, POSES, SEED + number)
    plan = space.plan(x, np.ones(POSES, dtype=int))
    row = np.repeat(np.arange(POSES), visits * len(MARKERS))
    zeros = np.zeros((len(row), 3))
    return Measurements(
        plan.q[row],
        plan.wrench[row],
        zeros,
        zeros + TRACKER,
        np.tile(MARKERS, (POSES * visits, 1)),
        visit=np.tile(np.repeat(np.arange(visits), len(MARKERS)), POSES) * 1.0,
    )


def _measured(study: Study, visits: int, joints: float, number: int) -> Measurements:
    """A set with its noise stated as it is."""
    data = _poses(study, visits, number)
    motion = joint_motion(study.model, data) * (joint_unit(study) * np.rad2deg(joints))
    noise = visit_covariance(data, data.sigma, motion, np.zeros(data.sigma.shape))
    k = all_compliances(study.model, study.compliances)
    beside = replace(study.model, sensors=(Marker(BodyPoint(data.marker.T)),))
    clean = equilibrium_deflection(beside, data.q, data.wrench, k)
    z = np.random.default_rng([SEED, number]).standard_normal(clean.shape)
    return replace(
        data,
        deflection=clean + noise.colour(z),
        covariance=noise,
        sigma=noise.std,
        tracker=data.sigma,
    )


def table(found: Sequence[Shares]) -> str:
    """A row for each robot and case."""
    header = [
        "robot",
        "visits",
        "joints move",
        "sets",
        "right noise: coverage",
        "worst",
        "p < 0.01",
        "white noise: coverage",
        "parts told: coverage",
        "named",
        "other fault named",
        "repeatability / true",
        "tracker / true",
    ]
    rows = []
    for one in found:
        numbers = [
            f"{np.mean(one.right):.1f}",
            f"{min(one.right):.1f}",
            f"{one.alarms:.1f}",
            f"{one.white:.1f}",
            f"{one.told:.1f}",
            f"{one.seen:.1f}",
            f"{one.blamed:.1f}",
            f"{one.repeatability[0]:.2f} +- {one.repeatability[1]:.2f}",
            f"{one.tracker[0]:.2f} +- {one.tracker[1]:.2f}",
        ]
        moves = "by 50 um" if one.moving else "no"
        rows.append([one.robot, str(one.visits), moves, str(one.runs), *numbers])
    return markdown_table(header, rows)


TEXT = """# Joints that do not return exactly

`python studies/moving_joints.py` wrote this file; it ends with code 1 if a target is missed.

Three markers are measured in each visit of 12 random feasible poses, new ones in each set. The
truth is the loaded equilibrium. The tracker errs by 5 um in each coordinate of a displacement, and
the joints by so much that markers move by 50 um, all of a visit together. Shares are in percent.

*Right noise*: the covariance of tracker and joints is stated. *White noise*: the tracker's alone
is, and believed. *Parts told*: the same, as `edtk identify` goes on: it names moving
joints, estimates tracker, joints and discrepancy, and takes them into account. *Named*: share of
these sets with that line. Estimates are means over the sets, with the standard deviation of one.

Targets: coverage of 93 to 97 % with the right noise, moving joints named in 95 % of the sets at
least where they move, and in 1 % where they do not; p < 0.01, and other faults named, in 2 %.

"""


def main() -> int:
    """Write the table; the exit code says whether all targets are met."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    found = []
    for name in robots():
        for visits, moving in CASES:
            found.append(run_case(name, visits, moving, runs))
            print(table(found[-1:]), flush=True)
    path = Path(__file__).with_suffix(".md")
    path.write_text(TEXT + table(found) + "\n", encoding="utf-8")
    return 0 if all(one.holds for one in found) else 1


if __name__ == "__main__":
    sys.exit(main())

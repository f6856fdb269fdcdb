"""Programs of days: the arm drives along the ways that the timetable has, and no others."""

from pathlib import Path

import numpy as np
import pytest

import edtk
from edtk.cell.robot_bodies import merged
from edtk.cell.shapes import Body, Capsule

STUDY = Path(__file__).parents[2] / "studies" / "kr270_cell.toml"
HOME = [0, -90, 90, 0, 0, 0]


def in_a_cell(**changes):
    study = edtk.load_study(STUDY)
    keys = study.specification.model_dump(exclude_unset=True, by_alias=True)
    scene = {**keys["scene"], "home_deg": HOME}
    return study.replace(scene=scene, **changes)


def plan_of(study, count=6):
    q = np.random.default_rng(3).uniform(*study.robot.limits, size=(2000, 6))
    q[:, 0] *= 0.15
    wrench = np.zeros((count, 6))
    wrench[: count // 2, 2], wrench[count // 2 :, 1] = -2500, 300
    return edtk.Plan(q[study.cell.free(q)][:count], wrench, np.ones(count, dtype=int))


def driven(study, day):
    """All poses of a day's steps, with the via poses before each [rad]."""
    poses = [np.deg2rad(HOME)]
    for step in day.steps:
        poses += [] if step.way is None else list(step.way.q[1:])
    return np.array(poses)


@pytest.mark.parametrize("load_changes", [None, 5])
def test_a_program_of_pairs_drives_along_the_ways_of_the_timetable(load_changes):
    study = in_a_cell(costs={} if load_changes is None else {"load_changes": load_changes})
    plan = plan_of(study)
    found = edtk.program(study, plan, "krl")
    moves = np.deg2rad([move.target for move in found.program.moves])
    expected = driven(study, edtk.timetable(study, plan))
    assert moves == pytest.approx(expected, abs=1e-4)


def test_a_pose_in_which_nothing_is_read_is_in_no_sheet_program_or_timetable():
    study = in_a_cell(
        sight={"own_body_mm": 200},
        marker=[
            {"name": "front", "position_mm": [0, 0, 0], "normal": [0, 1, 0], "acceptance_deg": 80}
        ],
        noise={"tracker_position_mm": [4500, 2500, 1200], "along": [10, 0.4], "across": [15, 6]},
        measurement={"rows": "position"},
    )
    plan = plan_of(study, 30)
    read = study.sight.rows(plan.q).any(axis=1)
    assert 0 < read.sum() < len(read)
    day = edtk.timetable(study, plan)
    rows = [step.row for step in day.steps if step.row is not None]
    assert sorted(set(rows)) == np.flatnonzero(read).tolist()
    assert len(edtk.template(study, plan)) == read.sum()
    moves = np.deg2rad([move.target for move in edtk.program(study, plan, "krl").program.moves])
    assert moves == pytest.approx(driven(study, day), abs=1e-4)


def test_a_weight_that_hangs_and_a_part_that_turns_are_not_one_body():
    ball = Capsule(np.zeros(3), np.zeros(3), 0.1)
    bodies = [Body("load", 5, (ball,)), Body("load", 5, (ball,), hangs_at=np.ones(3))]
    for both in (bodies, bodies[::-1]):
        with pytest.raises(ValueError, match="hangs"):
            merged(both)
    assert merged(bodies[1:] * 2)[0].hangs_at is not None

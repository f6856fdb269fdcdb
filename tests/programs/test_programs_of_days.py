"""Programs of days: the arm drives along the ways that the timetable has, and no others."""

from pathlib import Path

import numpy as np
import pytest
from program_readers import READERS

import edtk
from edtk.cell.robot_bodies import merged
from edtk.cell.shapes import Body, Capsule
from edtk.programs import writer

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


@pytest.mark.parametrize("brand", ["krl", "rapid", "urscript", "fanuc_ls"])
def test_programs_of_plans_are_read_back_to_the_digit_of_the_sheet(brand):
    """A degree's three decimals come back from radians, too, whose eighth is the last."""
    study = edtk.load_study(STUDY.with_name("kr270_milling.toml"))
    rng = np.random.default_rng(0)
    for _ in range(8):
        q = rng.uniform(*study.robot.limits, size=(6, 6))
        q[:, 0] = 0.0
        wrench = np.tile([0, 0, -2500.0, 0, 0, 0], (6, 1))
        plan = edtk.Plan(q, wrench, rng.integers(1, 4, 6))
        sheet = edtk.template(study, plan)[[f"q{i}_deg" for i in range(1, 7)]].to_numpy()
        program = edtk.program(study, plan, brand).program
        _, steps = READERS[brand](dict(writer.get(brand).files(program)))
        rows = [step[1:] for step in steps if step[0] == "rows"]
        moves = [list(step[1].values()) for step in steps if step[0] == "move"]
        assert sorted(i for a, b in rows for i in range(a, b + 1)) == list(range(1, len(sheet) + 1))
        for (first, last), values in zip(rows, moves, strict=True):
            own = sheet[first - 1 : last]
            np.testing.assert_array_equal(
                np.round(own, 3), np.tile(np.round(values, 3), (len(own), 1))
            )
            assert np.abs(own - values).max() <= np.rad2deg(0.5e-8) * (1 + 1e-6)

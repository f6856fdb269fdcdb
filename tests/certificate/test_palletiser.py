"""The example of a palletiser, from its study to commands.

What is measured comes from the arm's own mechanics, in which nothing of the models is.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from palletiser import at_rest, point

import edtk
from edtk.certificate.certificate import setting_to_dict
from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.tasks import neighbourhood as around
from edtk.design.plan import Plan
from edtk.robots.robot_file import robot_to_dict
from edtk.robots.workspace import neighbourhood
from edtk.system.errors import Note, UserError

STUDY = edtk.load_study(Path(__file__).parents[2] / "studies/palletiser.toml")
MILLING = edtk.load_study(Path(__file__).parents[2] / "studies/kr270_six_compliances.toml")
K = np.array([4e-7, 2.5e-7, 3e-7, 3e-6])
TOOL = np.array([0.4, 0.0, 0.3])
IN_USE = np.array([0.0, 0.0, 0.45])
GOAL = np.deg2rad([20, 35, 25, -10])
PUSH = np.array([0.0, 300.0, -1200.0])
NOTE = "in the sheet q3 is the angle of its motor; the joint itself is at q3 - q2"


def sheet_of(study, plan):
    """The study's own sheet of a plan, with its poses (m, 4) and forces (m, 3)."""
    with pytest.warns(Note, match=NOTE):
        sheet = edtk.template(study, plan)
    q = np.deg2rad(sheet[[f"q{j}_deg" for j in range(1, 5)]].to_numpy())
    return sheet, q, sheet[["Fx_N", "Fy_N", "Fz_N"]].to_numpy()


def displacements(q, forces):
    """How the tool point moves under each force, weights on (m, 3) [m]."""
    return np.array(
        [
            point(at_rest(at, K, force, TOOL), TOOL) - point(at_rest(at, K, 0 * force, TOOL), TOOL)
            for at, force in zip(q, forces, strict=True)
        ]
    )


def poses(m):
    """A plan of feasible poses, each under one of the study's loads."""
    rng = np.random.default_rng(1)
    q = rng.uniform(*STUDY.workspace.robot.limits, (40 * m, 4))
    q = q[STUDY.workspace.contains(q)][:m]
    loads = np.array([[*force, 0, 0, 0] for force in STUDY.specification.load.list_F_N])
    return Plan(q, loads[np.arange(m) % 3], np.ones(m, dtype=int))


def test_a_relaxation_is_verified_by_the_second_implementation(tmp_path):
    """Coupling, both limits and their margins are in the certificate, which fails without them."""
    study = STUDY.replace(candidates=300)
    path = tmp_path / "certificate.json"
    plan = edtk.relax(study, certificate=path, workers=1)
    elbow = np.rad2deg(plan.plan.q[:, 2] - plan.plan.q[:, 1])
    assert (elbow > -68 - 1e-9).all()
    assert edtk.verify(path, study=study).valid
    content = json.loads(path.read_text())
    joints = content["setting"]["robot"]["joints"]
    assert content["setting"]["coupled_margin"] == pytest.approx([np.deg2rad(2)])
    assert joints[3]["follows"]["others"] == [{"joint": 2, "factor": -1.0}]
    joints[2]["coupled"][0]["factor"] = -0.9
    path.write_text(json.dumps(content))
    assert not edtk.verify(path).valid


def test_a_hollow_wrist_is_verified_too(tmp_path):
    """Joint 6 is driven through joints 4 and 5, and 5 through 4: a chain of couplings."""
    table = [
        {"joint": "q5", "follows": "q4", "factor": 0.02},
        {"joint": "q6", "follows": "q4", "factor": 0.01},
        {"joint": "q6", "follows": "q5", "factor": -0.98, "joint_limits_deg": [-300, 300]},
    ]
    study = MILLING.replace(robot={"file": "kuka_kr270", "coupling": table}, candidates=100)
    path = tmp_path / "certificate.json"
    edtk.relax(study, certificate=path, workers=1)
    assert edtk.verify(path, study=study).valid
    assert not edtk.verify(path, study=MILLING).valid
    content = json.loads(path.read_text())
    del content["setting"]["robot"]["joints"][4]["coupled"]
    path.write_text(json.dumps(content))
    assert not edtk.verify(path).valid


@pytest.mark.cell("`[[robot.coupling]]`", "springs")
def test_springs_of_motors_come_back_and_make_good_commands():
    """Displacements by least energy, weights on: springs, and a command that makes up for them."""
    sheet, q, forces = sheet_of(STUDY, poses(15))
    rng = np.random.default_rng(5)
    sheet[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * displacements(q, forces) + rng.normal(
        0, 0.03, (15, 3)
    )
    found = edtk.identify(STUDY, sheet)
    off = (np.array(list(found.k.values())) - K) / np.array(list(found.std.values()))
    assert np.abs(off).max() < 3
    assert found.verdict == "good"
    task = edtk.compensate(STUDY, found)
    there = point(at_rest(task.command[0], K, PUSH, IN_USE), IN_USE)
    # Displacements leave out how the arm hangs without a load.
    wanted = point(at_rest(GOAL, K, 0 * PUSH, IN_USE), IN_USE)
    assert np.linalg.norm(there - wanted) < task.band[0, 1] < 0.1 * task.uncompensated[0]


def test_a_spring_in_the_elbow_is_another_robot():
    """With `follows` of the controller positions are the same, but not what loads the springs."""
    sheet, q, forces = sheet_of(STUDY, poses(9))
    sheet[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * displacements(q, forces)
    content = robot_to_dict(STUDY.robot)
    del content["coupling"]
    content["joints"][2]["limits_deg"] = [-105, 150]
    counts = {"follows": {"q3": {"joint": "q2", "factor": -1}}}
    elbow = STUDY.replace(robot=content, controller=counts)
    same = elbow.robot.forward(elbow.robot.of_shown(q))
    np.testing.assert_allclose(same, STUDY.robot.forward(q), atol=1e-14)
    found = edtk.identify(elbow, sheet)
    assert found.verdict == "bad"
    assert found.k["q2"] < 0.6e-7


@pytest.mark.cell("`[[robot.coupling]]`", "parameters")
def test_positions_tell_the_springs_and_a_long_link_alike():
    """A study with parameters: absolute positions of the hanging arm, whose forearm is too long."""
    study = STUDY.replace(
        parameters={
            "geometry": ["level.x"],
            "compliance": ["q1", "q2", "q3", "q4"],
            "base": False,
            "tool": False,
        },
        criteria=["rho0", "D"],
    )
    sheet, q, forces = sheet_of(study, poses(24))
    long = 0.5e-3

    def reached(a, tool):
        forearm = long * np.array([np.cos(a[0]) * np.cos(a[2]), np.sin(a[0]) * np.cos(a[2]), 0])
        return point(a, tool) + forearm - [0, 0, long * np.sin(a[2])]

    x = [reached(at_rest(at, K, force, TOOL), TOOL) for at, force in zip(q, forces, strict=True)]
    noise = np.random.default_rng(6).normal(0, 0.03, (24, 3))
    sheet[["x_mm", "y_mm", "z_mm"]] = 1e3 * np.array(x) + noise
    found = edtk.identify(study, sheet)
    table = found.to_frame().set_index("parameter")
    truth = [1e3 * long, *(1e6 * K)]
    assert (np.abs(table["value"] - truth) < 3 * table["std"]).all()
    task = edtk.compensate(study, found)
    there = reached(at_rest(task.command[0], K, PUSH, IN_USE), IN_USE)
    # Positions tell how it hangs, too: the tool comes to where the drawing has it, unloaded.
    assert np.linalg.norm(there - point(GOAL, IN_USE)) < 3e-5


def test_a_bound_over_every_pose_is_confirmed_where_joints_are_coupled(tmp_path):
    """Boxes are closed again, with the limit of the coupled joint; a better bound is refused."""
    path = tmp_path / "proof.json"
    edtk.relax(STUDY, "rho0", prove=1e-2, certificate=path)
    content = json.loads(path.read_text(encoding="utf-8"))
    proof = content["proof"]["continuum"]["coverings"]

    def checked():
        path.write_text(json.dumps(content), encoding="utf-8")
        return {one.claim: one for one in edtk.verify(path).claims}["bound_proved"]

    assert checked().holds
    content["claims"]["bound_proved"] *= 1 + 1e-6
    assert checked().reason == "the recomputed number differs"
    place = proof[0]["slacks"].index("A")
    used = [one for one in proof if any(mu[place] > 0 for mu in one["factors"])]
    for one in used:
        one["factors"] = [[*mu[:place], 0.0, *mu[place + 1 :]] for mu in one["factors"]]
    assert used
    assert "boxes are open" in checked().reason


def test_a_study_couples_the_joints_of_a_robot_file(tmp_path):
    """`[robot] file` with couplings is the file with them, and is written so again."""
    robot = Path(edtk.__file__).parent / "robots/builtin/palletiser.toml"
    text = robot.read_text(encoding="utf-8")
    (tmp_path / "arm.toml").write_text(text[: text.index("[[coupling]]")], encoding="utf-8")
    table = {"joint": "q3", "follows": "q2", "joint_limits_deg": [-70, 65]}
    study = STUDY.replace(robot={"file": str(tmp_path / "arm.toml"), "coupling": [table]})
    assert study.robot.couplings == STUDY.robot.couplings
    assert study.robot.digest == STUDY.robot.digest
    study.to_toml(tmp_path / "study.toml")
    again = edtk.load_study(tmp_path / "study.toml")
    assert again.robot.couplings == STUDY.robot.couplings
    assert again.specification.robot_file == str(tmp_path / "arm.toml")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"joint": "q3", "follows": "q9"}, "Study: robot: coupling: no free joint 'q9'"),
        ({"joint": "q6", "follows": "q6"}, "Study: robot: coupling: joint q6 is coupled to itself"),
        ({"joint": "q3"}, "Study: robot: coupling.0.follows: this key is required"),
    ],
)
def test_wrong_couplings_of_a_study_are_one_line(table, message):
    """A joint that does not exist, itself, and a key that is missing."""
    with pytest.raises(UserError) as caught:
        STUDY.replace(robot={"file": "kuka_kr270", "coupling": [table]}).robot  # noqa: B018
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_neighbourhood_keeps_to_the_limits_of_coupled_joints():
    """Poses beyond those of the elbow itself are drawn back to them; a certificate has the same."""
    robot = STUDY.robot
    within = np.deg2rad(40)
    q = np.deg2rad([0.0, 60.0, 0.0, 0.0])  # of the elbow, -60 where -70 is the limit
    poses = neighbourhood(robot, q, within)
    assert robot.bounds.excess(poses).max() < 1e-12
    free = neighbourhood(replace(robot, couplings=()), q, within)
    back = ~np.isclose(poses, free, rtol=0, atol=1e-12).all(axis=1)
    np.testing.assert_array_equal(back, robot.bounds.coupled.excess(free).max(axis=1) > 1e-12)
    assert back.any()
    shortened = (poses - q)[back] / (free - q)[back]
    np.testing.assert_allclose(shortened, shortened[:, :1] * np.ones(4), rtol=1e-9)
    chain = Chain.from_dict(setting_to_dict(STUDY, STUDY.space, STUDY.main_criterion)["robot"])
    both = [np.array(sorted(one.round(9).tolist())) for one in (poses, around(chain, q, within))]
    np.testing.assert_allclose(*both, rtol=0, atol=2e-9)

"""A KR 270 with a gravity compensator, simulated apart from edtk: what edtk makes of it."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import edtk
from edtk.certificate.certificate import setting_to_dict
from edtk.certificate.recompute.setting import Setting
from edtk.design.plan import Plan
from edtk.findings.fitted_data import FittedData
from edtk.fit.fitted_geometry import loading_in
from edtk.fit.measurements import Measurements
from edtk.measure.equilibrium import Rest
from edtk.robots.load_robot import load_robot
from edtk.study.study_geometry import StudyGeometry

ROBOT = load_robot("kuka_kr270_compensator")
K = np.array([0, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
JOINTS = ("q2", "q3", "q4", "q5", "q6")
LOAD = [300.0, -200.0, -2500.0]
TOOL = {"position_mm": [611.5, 0, -460]}
REQUIRED = {
    "robot": "kuka_kr270_compensator",
    "tool": TOOL,
    "load": {"F_N": LOAD},
    "measurement": {"sigma_mm": 0.03},
    "joints": {"unknown": list(JOINTS), "fixed_deg": {"q1": 0}},
    "test_pose": {"q_deg": [0, -60, 60, 30, 30, 0], "tool": TOOL, "load": {"F_N": LOAD}},
}
GUESS = {"simulation": {"compliance_rad_per_Nm": dict(zip(JOINTS, K[1:].tolist(), strict=True))}}
STIFF = {"joint": "q2", "anchors_mm": [[0, 200, -650], [-180, 200, 0]], "preload_N": 20000}


@pytest.fixture(scope="module")
def simulated(script):
    """Makes the arm of a robot, with its weights and compensators."""
    module = script("simulated_arm.py")

    def arm(robot, k=K):
        springs = [
            module.Compensator(
                pull.place,
                pull.given.before,
                pull.given.behind,
                preload=pull.given.preload,
                stiffness=pull.given.stiffness if pull.given.medium == "coil" else 0.0,
                slope=pull.given.stiffness / pull.given.preload * (pull.given.medium == "gas"),
            )
            for pull in robot.pulls
        ]
        return module.SimulatedArm(
            origins=np.array([joint.origin for joint in robot.chain]),
            axes=np.array([joint.axis for joint in robot.chain]),
            compliance=k,
            tool=robot.tool,
            masses=tuple(
                module.Mass(link.mass, module.Point(j, link.center))
                for j, link in enumerate(robot.links)
            ),
            compensators=tuple(springs),
        )

    return arm


def poses(count, seed=0):
    """Poses within the limits, joint 1 where it is fixed."""
    q = np.random.default_rng(seed).uniform(*ROBOT.limits, (count, 6))
    q[:, 0] = 0.0
    return q


def tips(robot, q):
    return robot.forward(q)[:, :3, 3]


def sheet(study, rest, q):
    """What an instrument without noise reads of displacements; `rest` gives where the arm rests."""
    wrench = np.array([*LOAD, 0, 0, 0])
    start = q if study.is_absolute else q + rest(q, 0 * wrench)
    moved = tips(study.robot, q + rest(q, wrench)) - tips(study.robot, start)
    table = pd.DataFrame(np.rad2deg(q), columns=[f"{name}_deg" for name in ROBOT.joint_names])
    return table.assign(**{f"d{axis}_mm": 1e3 * moved[:, i] for i, axis in enumerate("xyz")})


def estimated(study, table):
    """Compliances by the loaded equilibrium, without all else that `identify` looks for."""
    sigma = np.full(3, 3e-5)
    load = np.array([*LOAD, 0, 0, 0])
    data = Measurements.from_csv(table, study.robot, study.fixed, load, sigma, study.model)
    return FittedData.of(study, data).fit.k


@pytest.mark.parametrize("medium", ["coil", "gas"])
def test_arm_rests_at_the_minimum_of_its_energy(simulated, medium):
    """Weights, compensator and load, by scipy's minimum of the energy: to a nanometre."""
    compensator = replace(ROBOT.compensators[0], medium=medium)
    study = edtk.Study(**REQUIRED | {"robot": replace(ROBOT, compensators=(compensator,))})
    q = poses(3)
    wrench = np.array([*LOAD, 0, 0, 0])
    rest = Rest.of(study.model, q, wrench, K)
    arm = simulated(study.robot)
    for found, load in ((rest.start, 0 * wrench), (rest.end, wrench)):
        expected = q + arm.least_energy(q, load)
        assert np.abs(expected - q).max() > 1e-3
        away = tips(study.robot, found) - tips(study.robot, expected)
        assert np.abs(away).max() < 1e-9


@pytest.mark.cell("`[[robot.compensator]]`", "springs")
@pytest.mark.parametrize("reference", ["unloaded", "nominal"])
def test_stated_compensator_leaves_the_true_compliances(simulated, reference):
    """Differences, and displacements from the nominal robot, which see its 12 kN m, too."""
    study = edtk.Study(
        **REQUIRED | {"measurement": {"sigma_mm": 0.03, "reference": reference}, "test_pose": None}
    )
    arm = simulated(study.robot)
    table = sheet(study, arm.rest, poses(12))
    np.testing.assert_allclose(estimated(study, table), K[1:], rtol=1e-6)
    plain = study.replace(robot=replace(ROBOT, compensators=()))
    off = np.abs(estimated(plain, table)[0] / K[1] - 1)
    assert off > (0.5 if reference == "nominal" else 1e-3)


def test_stiff_compensator_is_a_part_of_the_joint(simulated):
    """One that nearly doubles the stiffness of joint 2, which is not ascribed to the gear."""
    stiff = [STIFF | {"stiffness_N_per_mm": 1e5}]
    table = {"file": "kuka_kr270", "compensator": stiff}
    near = {"joints": REQUIRED["joints"] | {"limits_deg": {"q2": [-3, 0]}}}
    study = edtk.Study(**REQUIRED | {"robot": table, "test_pose": None} | near | GUESS)
    arm = simulated(study.robot)
    table = sheet(study, arm.least_energy, poses(12) * [1, 0.01, 1, 1, 1, 1])
    np.testing.assert_allclose(estimated(study, table), K[1:], rtol=1e-6)
    assert estimated(study.replace(robot="kuka_kr270"), table)[0] < 0.6 * K[1]


@pytest.mark.parametrize("reference", ["unloaded", "nominal"])
def test_commands_bring_the_loaded_arm_to_its_goal(simulated, reference):
    """Of differences the goal is where the unloaded arm rests, else the rigid robot's."""
    measurement = {"sigma_mm": 0.03, "reference": reference}
    study = edtk.Study(**REQUIRED | {"measurement": measurement} | GUESS)
    k = dict(zip(JOINTS, K[1:].tolist(), strict=True))
    q = poses(3, seed=2) * 0.7
    wrench = np.tile([*LOAD, 0, 0, 0], (3, 1))
    found = edtk.compensate(study, {"k": k}, Plan(q, wrench, np.ones(3, dtype=int)))
    robot = study.robot
    arm = simulated(robot)
    start = q if reference == "nominal" else q + arm.rest(q, 0 * wrench)
    goal = tips(robot, start)
    left = tips(robot, found.command + arm.rest(found.command, wrench)) - goal
    assert np.abs(left).max() < 1e-9
    before = np.linalg.norm(tips(robot, q + arm.rest(q, wrench)) - goal, axis=1)
    # Joint 1 counts as rigid, and what it may bend adds to the square.
    assert (found.uncompensated > before).all()
    np.testing.assert_allclose(found.uncompensated, before, rtol=1e-3)


@pytest.mark.parametrize("reference", ["unloaded", "nominal"])
def test_certificate_has_the_same_rows_by_its_own_formulas(reference):
    """Rows of experiments and targets of tasks, with a compensator that gives way much."""
    stiff = [STIFF | {"stiffness_N_per_mm": 2e4}]
    robot = {"file": "kuka_kr270_compensator", "compensator": stiff}
    measurement = {"sigma_mm": 0.03, "reference": reference}
    study = edtk.Study(**REQUIRED | {"robot": robot, "measurement": measurement} | GUESS)
    plain = setting_to_dict(study, study.space, study.main_criterion)
    setting = Setting.from_dict(json.loads(json.dumps(plain)))
    q = poses(4)
    own = study.space.at(q).regressor
    wrench = np.tile([*LOAD, 0, 0, 0], (4, 1))
    given = setting.whitened_rows(q, wrench)
    np.testing.assert_allclose(given, own, rtol=0, atol=1e-10 * np.abs(own).max())
    target = setting.tasks.targets("rho0")[0]
    expected = study.tasks.target
    np.testing.assert_allclose(target, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    plain = replace(study.model, gives=None).regressor(q, wrench) / 3e-5
    assert np.abs(own - plain).max() > 0.01 * np.abs(own).max()


def test_results_of_another_compensator_are_refused(simulated, tmp_path):
    """By `predict` and `compensate`, in one line; also where there is none any more."""
    study = edtk.Study(**REQUIRED)
    found = edtk.identify(study, sheet(study, simulated(study.robot).rest, poses(12)))
    (tmp_path / "k.json").write_text(json.dumps(found.to_dict()))
    other = replace(ROBOT.compensators[0], preload=6e4)
    for compensators in ((), (other,)):
        changed = study.replace(robot=replace(ROBOT, compensators=compensators))
        with pytest.raises(edtk.UserError, match="of a robot with other compensators"):
            edtk.compensate(changed, tmp_path / "k.json")
        with pytest.raises(edtk.UserError, match="of another robot"):
            edtk.predict(
                changed, tmp_path / "k.json", sheet(study, simulated(ROBOT).rest, poses(2))
            )
    assert edtk.compensate(study, tmp_path / "k.json").remaining is not None


@pytest.mark.cell("`[[robot.compensator]]`", "parameters")
@pytest.mark.parametrize("reference", ["unloaded", "nominal"])
def test_stated_compensator_is_heeded_by_visits(simulated, reference):
    """The same springs by a study with [parameters], changes and positions alike."""
    parameters = {"compliance": list(JOINTS), "geometry": [], "base": False, "tool": False}
    given = {key: value for key, value in REQUIRED.items() if key not in ("joints", "test_pose")}
    measurement = {"sigma_mm": 0.03, "reference": reference}
    fixed = {"fixed_deg": {"q1": 0}}
    study = edtk.Study(
        **given | {"parameters": parameters, "measurement": measurement, "joints": fixed}
    )
    robot = study.robot
    arm = simulated(robot)
    q = poses(12)
    wrench = np.array([*LOAD, 0, 0, 0])
    start = q if study.is_absolute else q + arm.rest(q, 0 * wrench)
    moved = tips(robot, q + arm.rest(q, wrench)) - tips(robot, start)
    noise = 3e-5 * np.random.default_rng(0).normal(size=moved.shape)
    table = pd.DataFrame(np.rad2deg(q), columns=[f"{name}_deg" for name in robot.joint_names])
    table[["Fx_N", "Fy_N", "Fz_N"]] = LOAD
    for i, axis in enumerate("xyz"):
        table[f"d{axis}_mm"] = 1e3 * (moved + noise)[:, i]
    found = edtk.identify(study, table).to_dict()["parameters"]
    away = [(found[f"k_{name}"]["value"] * 1e-6 - k) for name, k in zip(JOINTS, K[1:], strict=True)]
    std = [found[f"k_{name}"]["std"] * 1e-6 for name in JOINTS]
    assert np.abs(np.array(away) / std).max() < 3
    assert std[0] < 0.01 * K[1]


ASIDE = ["q2.x", "q2.rx", "q2.rz"]  # springs across joint 2, which the compensator beside it loads
SOFT = {"q2.x": 2e-9, "q2.rx": 8e-8, "q2.rz": 6e-8}


def aside():
    """Visits of an arm whose second joint gives way across its axis, too."""
    return edtk.Study(
        robot="kuka_kr270_compensator",
        tool=TOOL,
        load={"F_N": LOAD},
        measurement={"sigma_mm": 0.03},
        marker=[{"name": "A"}],
        parameters={
            "springs": ["joints", *ASIDE],
            "compensators": ["q2", "q2.anchor1.y"],
            "geometry": [],
            "base": False,
            "tool": False,
        },
        joints={"fixed_deg": {"q1": 0}},
        candidates=30,
    )


def test_compensator_beside_the_arm_loads_springs_across_its_joint(simulated, script, derivative):
    """Its two anchors are off the plane of the arm: rests agree to a nanometre, and rows."""
    study = aside()
    setting = StudyGeometry.of(study)
    model = setting.model
    names = [one.name.removeprefix("k_") for one in model.parameters]
    changes = {"compensator.q2.stiffness": 2e3, "compensator.q2.preload": -3e3}
    sizes = SOFT | changes | {"compensator.q2.anchor1.y": 0.02}
    theta = np.array([sizes.get(name, 4e-7) for name in names])
    given = ROBOT.compensators[0]
    q = poses(4)
    wrench = np.tile([*LOAD, 0, 0, 0], (4, 1))
    point = script("simulated_arm.py").Point()

    def at_rest(scale):
        own = dict(zip(names, theta * scale, strict=True))
        k = [own[name] for name in (*ROBOT.joint_names, *ASIDE)]
        changed = replace(
            given,
            stiffness=given.stiffness + own["compensator.q2.stiffness"],
            preload=given.preload + own["compensator.q2.preload"],
            before=given.before + own["compensator.q2.anchor1.y"] * np.array([0, 1, 0]),
        )
        arm = simulated(replace(study.robot, compensators=(changed,)), np.array(k))
        arm = arm.replace(elastic=((1, "tx"), (1, "rx"), (1, "rz")))
        return arm.points(q, [point], arm.rest(q, wrench))

    load = loading_in(model.bending(theta), q, wrench, setting.loads, np.zeros(4, dtype=bool))
    seen = model.see(theta, q, load)
    there = at_rest(np.ones(model.p))
    np.testing.assert_allclose(seen.points, there, rtol=0, atol=1e-9)
    expected = derivative(at_rest, np.ones(model.p))
    size = np.abs(expected).max(axis=(0, 1, 2))
    found = seen.jacobian * theta
    np.testing.assert_allclose(found / size, expected / size, rtol=0, atol=1e-7)
    # 70 kN, 0.2 m beside the arm: far more than the load does to these springs.
    across = [names.index("q2.rx"), names.index("q2.rz")]
    assert (size[across] > 1e-4).all()


def test_certificate_knows_what_a_compensator_does_across_its_joint(tmp_path):
    """The second implementation finds the rows, and finds out an anchor elsewhere."""
    path = tmp_path / "c.json"
    edtk.relax(aside(), "D", certificate=path, continuous=False)
    content = json.loads(path.read_text())
    assert edtk.verify(path).valid
    weights = content["setting"]["physics"]["weights"]
    pull = next(one for one in weights if "pull" in one)
    pull["anchors"] = (np.array(pull["anchors"]) * [1, 0.5, 1]).tolist()
    assert not edtk.verify(content).valid

"""What a robot has beside six ideal springs is named, by days of a robot simulated apart."""

from dataclasses import replace

import numpy as np
import pytest
from readings import STUDY

from edtk.calibration.detect import Promised, detect, sized_faults
from edtk.design.plan import Plan
from edtk.findings.causes.faults import FAULTS, cause_wording
from edtk.findings.causes.find_causes import find_causes
from edtk.findings.causes.scene import Displacements
from edtk.fit.measurements import Measurements
from edtk.measure.task import all_compliances

MODEL = STUDY.model
ROBOT = MODEL.robot
K = all_compliances(MODEL, STUDY.compliances)
POSES = np.random.default_rng(3).uniform(*ROBOT.limits, size=(14, 6))
LOADS = np.zeros((14, 6))
LOADS[:7, 2] = -2500.0
LOADS[7:11, 2] = -1000.0
LOADS[11:, 1] = 1500.0
LIGHT = 1e-3  # of these loads nothing but first orders remains


@pytest.fixture(scope="module")
def plain(ideal_arm):
    """A KR 270 of ideal springs."""
    return ideal_arm(ROBOT, K)


def across(arm, share):
    """The arm with bearings of joint 3 that bend about both axes across its own."""
    return arm.replace(compliance=np.append(K, [share * K[2]] * 2), elastic=((2, "rx"), (2, "rz")))


def stiffer(simulation, arm, share, most):
    """The arm whose second joint is stiffer by a share under a load than under none."""
    return arm.replace(laws=(simulation.Law(1, "cubic", -share * K[1] / most**2),))


def balanced(simulation, arm, torque):
    """The arm with a coil across joint 2 that is unloaded at no length, of so much torque."""
    before, after = np.array([-0.5, 0.0, -0.5]), np.array([0.2, 0.0, 0.0])
    rate = torque / np.linalg.norm(before) / np.linalg.norm(after)
    one = simulation.Compensator(1, before, after, rate * np.linalg.norm(after - before), rate)
    return arm.replace(compensators=(one,))


def shown(simulation, arm, wrench, absolute=False, tool=None, poses=POSES):
    """Displacements (m, 3) of the tool point."""
    point = [simulation.Point()]
    arm = arm if tool is None else arm.replace(tool=tool)
    loaded = arm.points(poses, point, arm.rest(poses, wrench))
    rest = None if absolute else arm.rest(poses, np.zeros_like(wrench))
    return (loaded - arm.points(poses, point, rest))[:, 0]


def data_of(moved, wrench, absolute=False, times=1):
    """A sheet."""
    m = len(moved)
    sigma = np.tile(STUDY.sigma, (m, 1))
    data = Measurements(POSES, wrench, moved, sigma, np.zeros((m, 3)), absolute=absolute)
    return data[np.repeat(np.arange(m), times)]


def family_of(data, name, joint, shape=0):
    """One model of a fault, and the scene."""
    scene = Displacements(MODEL, data, data.regressor(MODEL), STUDY.compliances)
    every = scene.families(FAULTS[name].models)
    return scene, next(one for one in every if (one.joint, one.shape) == (joint, shape))


def assert_same(found, made):
    """Columns are those of a difference of two simulated arms."""
    np.testing.assert_allclose(found, made, rtol=0, atol=2e-5 * np.abs(made).max())


def test_a_bearing_that_bends_moves_as_its_column_says(simulation, plain):
    """The column of springs across joint 3 is the difference of two simulated arms."""
    wrench = LIGHT * LOADS
    scene, family = family_of(data_of(np.zeros((14, 3)), wrench), "lateral", "q3")
    arms = [across(plain, share) for share in (-1.0, 1.0)]
    less, more = (shown(simulation, arm, wrench) for arm in arms)
    assert_same(family.derivative_at_zero(scene.k)[..., 0], (more - less) / 2)


def test_a_stiffening_spring_moves_as_its_column_says(simulation, plain):
    """So is that of a spring with a cube of its torque."""
    wrench = LIGHT * LOADS
    scene, family = family_of(data_of(np.zeros((14, 3)), wrench), "stiffening", "q2", shape=1)
    most = np.abs(scene.torque[:, 0]).max()
    less, more = (
        shown(simulation, stiffer(simulation, plain, share, most), wrench) for share in (1.0, -1.0)
    )
    assert_same(family.derivative_at_zero(scene.k)[..., 0], (more - less) / 2)


@pytest.mark.parametrize("absolute", [True, False])
def test_a_compensator_moves_as_its_column_says(simulation, plain, absolute):
    """So is that of a coil across joint 2: of its torque, and of the stiffness that it adds."""
    wrench = LIGHT * LOADS
    data = data_of(np.zeros((14, 3)), wrench, absolute)
    scene, family = family_of(data, "compensator", "q2")
    size = 10.0 if absolute else 1000.0
    less, more = (
        shown(simulation, balanced(simulation, plain, s * size), wrench, absolute) for s in (-1, 1)
    )
    columns = family.derivative_at_zero(scene.k)
    made = (more - less) / (2 * size)
    c = np.linalg.lstsq(columns.reshape(-1, 2), made.ravel(), rcond=None)[0]
    assert np.linalg.norm(c) == pytest.approx(1.0, rel=1e-3)
    assert c[0] / c[1] == pytest.approx(1.0, rel=1e-3)  # anchors 45 degrees apart
    np.testing.assert_allclose(columns @ c, made, rtol=0, atol=1e-3 * np.abs(made).max())


def test_springs_that_vary_move_as_their_columns_say(simulation, plain):
    """All joints that are softer by the sine of their angles are the sum of their columns."""
    wrench = LIGHT * LOADS
    data = data_of(np.zeros((14, 3)), wrench)
    h = 1e-3
    less, more = (shown(simulation, plain.replace(varying=s), wrench) for s in (h, -h))
    each = [family_of(data, "varying", name) for name in ROBOT.joint_names[1:]]
    q1 = shown(simulation, plain.replace(compliance=np.append(0, K[1:])), wrench)
    own = shown(simulation, plain, wrench) - q1  # that of joint 1, which varies too
    total = sum(one.derivative_at_zero(scene.k)[..., 1] for scene, one in each)
    made = (more - less) / (2 * h) - own * np.sin(POSES[:, :1])
    assert_same(total, made)


def named(simulation, arm, seed, absolute=False):
    """The causes of a day."""
    clean = shown(simulation, arm, LOADS, absolute)
    data = data_of(clean, LOADS, absolute, times=2)
    noise = STUDY.sigma * np.random.default_rng(seed).standard_normal(data.deflection.shape)
    data = replace(data, deflection=data.deflection + noise)
    # Joint 1 counts as rigid, and is: no column is of it.
    return find_causes(MODEL, data, data.deflection, tasks=STUDY.tasks).named


@pytest.mark.slow
@pytest.mark.parametrize(
    ("piece", "joint", "size"),
    [("lateral", "q3", 30.0), ("stiffening", "q2", -40.0), ("compensator", "q2", 12e3)],
)
def test_the_missing_piece_is_named_with_its_size_and_effect(simulation, plain, piece, joint, size):
    """It comes first, with its joint, its size, and how far it puts the test pose off."""
    rigid = plain.replace(compliance=np.append(0, K[1:]))
    arm = {
        "lateral": rigid.replace(
            compliance=np.append(rigid.compliance, [0.3 * K[2]] * 2),
            elastic=((2, "rx"), (2, "rz")),
        ),
        "stiffening": stiffer(simulation, rigid, 0.4, 5e3),
        "compensator": balanced(simulation, rigid, 12e3),
    }[piece]
    absolute = piece == "compensator"
    cause = named(simulation, arm, 0, absolute)[0]
    assert (cause.cause, cause.joint) == (piece, joint)
    if piece != "stiffening":  # whose size is that under the largest load of the sheet
        assert cause.size == pytest.approx(size, abs=4 * cause.std)
    task = STUDY.tasks[0]
    moved = shown(simulation, arm, task.wrench[None], absolute, task.placed.tool, task.q[None])
    clean = shown(simulation, arm, LOADS, absolute)
    A = data_of(clean, LOADS).regressor(MODEL).reshape(-1, MODEL.p)
    k = np.linalg.lstsq(A, clean.ravel(), rcond=None)[0]
    off = np.linalg.norm(moved[0] - task.regressor @ k)
    assert cause.effect == pytest.approx(off, rel=0.35)
    assert joint in cause_wording(cause)


@pytest.mark.slow
def test_plain_arms_lack_nothing(simulation, plain):
    """Of ideal springs no piece is named."""
    rigid = plain.replace(compliance=np.append(0, K[1:]))
    assert [named(simulation, rigid, seed) for seed in range(3)] == [()] * 3


@pytest.mark.slow
def test_a_plan_tells_missing_pieces():
    """More experiments notice them with a larger chance, and tell them apart."""
    sizes = {"lateral": "30%", "varying": "10%"}
    chances = []
    for times in (1, 3):
        plan = Plan(POSES, LOADS, np.full(14, times))
        found, (pair,) = detect(Promised.displacements(STUDY, plan), sized_faults(STUDY, sizes))
        chances.append([one.power for one in found])
    assert all(few < many for few, many in zip(*chances, strict=True))
    assert pair.right > 0.8


def test_sizes_of_pieces_have_units_of_people():
    """Shares of a compliance, and newton metres; what is across a sprung axis is no piece."""
    sized = sized_faults(STUDY, {"compensator": "12000Nm", "stiffening": "-20%"})
    assert [one.si for one in sized] == [12000.0, -0.2]
    scene, _ = family_of(data_of(np.zeros((14, 3)), LOADS), "lateral", "q3")
    names = [one.joint for one in scene.families(FAULTS["lateral"].models)]
    assert "q3.rx" in names
    assert "q5.rx" not in names  # the axis of joint 4, in the wrist

"""The robot that is simulated apart from edtk, and edtk's models against it."""

import numpy as np
import pytest
from scipy import integrate

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import equilibrium
from edtk.robots.frames import BodyPoint
from edtk.robots.load_robot import load_robot
from edtk.robots.weights import DeadWeights, Loading

KR270 = np.array([4e-7, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])  # [rad/(N m)]
LATERAL = 1e-7  # of turns [rad/(N m)], and a tenth of it of shifts [m/N]
POSITION = 1e-9  # to which equilibria agree [m]
ROWS = 1e-7  # to which rows agree, of the largest


@pytest.fixture(scope="module")
def module(script):
    return script("simulated_arm.py")


@pytest.fixture(scope="module")
def robot():
    return load_robot("kuka_kr270")


@pytest.fixture(scope="module")
def arm_of(script):
    """A function that reads the arrays of a simulated arm from a drawing of edtk."""
    return script("kept_promises.py").arm_of


@pytest.fixture(scope="module")
def plain(arm_of, robot):
    """A KR 270 of six ideal springs."""
    return arm_of(robot, KR270)


@pytest.fixture(scope="module")
def full(module, plain):
    """The same with a compensator, a weight, and full matrices of six springs at each joint."""
    own = {1: "ry", 2: "ry", 4: "ry", 0: "rz", 3: "rx", 5: "rx"}
    elastic = tuple((j, one) for j in range(6) for one in module.MOTIONS if own[j] != one)
    sizes = [LATERAL / (1 if one.startswith("r") else 10) for _, one in elastic]
    size = np.sqrt(np.concatenate([KR270, sizes]))
    A = np.random.default_rng(3).normal(size=(size.size, 2 * size.size))
    coupled = 0.7 * np.eye(size.size) + 0.3 * A @ A.T / (2 * size.size)
    link = module.Point(1, np.array([0.5, 0.0, 0.0]))
    across = module.Compensator(
        1, np.array([-0.6, 0.0, -0.3]), np.array([0.3, 0.0, 0.1]), preload=5e3, stiffness=4e4
    )
    return plain.replace(
        compliance=size[:, None] * coupled * size,
        elastic=elastic,
        masses=(module.Mass(400.0, link),),
        compensators=(across,),
    )


def loaded_poses(robot, count, torque=0.0):
    """Some poses within the limits, and wrenches."""
    rng = np.random.default_rng(7)
    q = rng.uniform(*robot.limits, (count, robot.n))
    wrench = rng.normal(size=(count, 6)) * [1500, 1500, 2500, torque, torque, torque]
    return q, wrench


def test_arm_rests_at_the_minimum_of_its_energy(full, robot):
    """Springs that give way to what loads them end where scipy finds the least energy."""
    q, wrench = loaded_poses(robot, 2)
    rest = full.rest(q, wrench)
    least = full.least_energy(q, wrench)
    np.testing.assert_allclose(rest, least, rtol=0, atol=1e-14)
    assert np.abs(rest).max() > 1e-4


def test_plain_arm_rests_where_edtk_has_it(plain, robot):
    """Six springs under forces and torques, by two codes."""
    q, wrench = loaded_poses(robot, 20, torque=300.0)
    expected = equilibrium(robot, q, wrench, KR270)
    np.testing.assert_allclose(plain.rest(q, wrench), expected, rtol=1e-12, atol=1e-16)


def test_energies_of_compensators_are_integrals_of_their_forces(module):
    """A coil and a gas between two anchors, whose distance grows from its first value."""
    at = np.zeros(3)
    far = np.array([0.4, 0.0, 0.0])
    coil = module.Compensator(0, at, far, preload=2000.0, stiffness=3e4)
    gas = module.Compensator(0, at, far, preload=2000.0, slope=4.0)
    laws = (coil, lambda s: 2000 + 3e4 * s), (gas, lambda s: 2000 / (1 - 4 * s))
    for one, force in laws:
        energy = one.energy(at, 1.25 * far) - one.energy(at, far)
        assert energy == pytest.approx(integrate.quad(force, 0, 0.1)[0], rel=1e-12)


def test_beam_is_stiffer_than_its_parts(module):
    """A beam is two of half its length, one behind the other."""
    link = np.array([0.6, 0.0, 0.8])
    whole = module.bending(2 * link, 5.0, 3.0)
    half = module.bending(link, 5.0, 3.0)
    # A force at the end of the first half's neighbour is a force and a torque at its own end.
    T = np.eye(6)
    T[:3, 3:] = -np.cross(np.eye(3), link)  # a turn w moves what is a link away by w x link
    np.testing.assert_allclose(half + T @ half @ T.T, whole, atol=1e-15)


def test_drives_on_the_base_turn_a_parallelogram(plain, robot):
    """Where the third motor sits on the base, the second one lifts the upper arm alone."""
    P = np.eye(6)
    P[2, 1] = -1.0
    arm = plain.replace(coupling=P)
    q, wrench = loaded_poses(robot, 2)
    drives = np.linalg.solve(P, q.T).T
    x = arm.rest(drives, wrench)
    np.testing.assert_allclose(x, arm.least_energy(drives, wrench), rtol=0, atol=1e-14)
    # Loads of the drives are those of the joints, folded.
    loads = arm.loads(drives, wrench, np.zeros((2, 6)))
    np.testing.assert_allclose(loads, plain.loads(q, wrench, np.zeros((2, 6))) @ P, rtol=1e-12)


def test_palletiser_rests_where_edtk_has_it(module, arm_of):
    """Drives on the base, a joint that rods keep level, and weights of all links; and its rows."""
    robot = load_robot("palletiser")
    k = np.array([4e-7, 2.5e-7, 3e-7, 3e-6])
    weights = [module.Mass(x.mass, module.Point(j, x.center)) for j, x in enumerate(robot.links)]
    arm = arm_of(robot, k).replace(masses=tuple(weights))
    q = np.random.default_rng(2).uniform(*robot.limits, (5, 4))
    wrench = np.tile([300.0, -900.0, -1500.0, 50.0, -80.0, 120.0], (5, 1))
    centers = tuple(BodyPoint(link.center, j) for j, link in enumerate(robot.links))
    hung = DeadWeights(tuple(link.mass for link in robot.links), centers, len(robot.chain))
    there = arm.points(q, [arm.at], arm.rest(q, wrench))[:, 0]
    rest = q + equilibrium(robot, q, wrench, k, loading=Loading(weights=hung))
    np.testing.assert_allclose(there, robot.forward(rest)[:, :3, 3], rtol=0, atol=POSITION)
    light = arm.replace(masses=())
    rows = ElastostaticModel(robot).regressor(q, wrench)
    np.testing.assert_allclose(rows, differences(light, q, wrench), rtol=0, atol=rows_to(rows))


def rows_to(rows):
    """By how much two codes may differ in rows."""
    return ROWS * np.abs(rows).max()


def differences(arm, q, wrench, at=0.0):
    """Rows (m, 3, n) of the point where the wrench acts, by springs about such a share of them."""
    columns = []
    for j, k in enumerate(arm.compliance):
        ends = []
        for step in (-2, -1, 1, 2):
            some = at * arm.compliance
            some[j] += 1e-3 * step * k
            bent = arm.replace(compliance=some)
            ends.append(bent.points(q, [arm.at], bent.rest(q, wrench))[:, 0])
        columns.append((ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12e-3 * k))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("kind", ["square", "cubic", "sign", "gap"])
def test_laws_give_way_by_what_loads_them_at_rest(module, plain, robot, kind):
    """At rest each coordinate is where its springs are under the load that they then have."""
    arm = plain.replace(laws=(module.Law(1, kind, 1e-5 / 4000 ** (kind != "gap")),))
    q, wrench = loaded_poses(robot, 3, torque=100.0)
    if kind == "cubic":
        arm = arm.replace(laws=(module.Law(1, kind, 1e-5 / 4000**3),))
    x = arm.rest(q, wrench)
    t = arm.loads(q, wrench, x)
    law = {"square": t * abs(t), "cubic": t**3, "sign": abs(t), "gap": np.sign(t)}[kind][:, 1]
    expected = t * KR270
    expected[:, 1] += arm.laws[0].size * law
    np.testing.assert_allclose(x, expected, rtol=1e-12, atol=1e-16)


def test_friction_holds_its_part_of_the_load(plain, robot):
    """Nothing turns below the friction, and all turns by the rest beyond it."""
    q, wrench = loaded_poses(robot, 3)
    held = 1.01 * np.abs(plain.loads(q, wrench, np.zeros((3, 6)))).max()
    np.testing.assert_array_equal(plain.replace(friction=np.full(6, held)).rest(q, wrench), 0)
    arm = plain.replace(friction=np.full(6, 100.0))
    x = arm.rest(q, wrench)
    t = arm.loads(q, wrench, x)
    np.testing.assert_allclose(x, KR270 * np.sign(t) * np.maximum(abs(t) - 100, 0), rtol=1e-12)

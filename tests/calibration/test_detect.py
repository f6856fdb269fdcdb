"""The chance that a plan shows a fault, before anything is measured."""

from dataclasses import replace

import numpy as np
import pytest
from readings import PLAN, STUDY
from scipy.special import chndtr

from edtk.calibration.detect import Promised, detect, sized_faults
from edtk.calibration.planned import planned_measurements
from edtk.design.plan import Plan
from edtk.findings.causes.faults import families
from edtk.findings.causes.scene import Displacements
from edtk.fit.distributions import chi_square_quantile
from edtk.fit.least_squares import Whitened
from edtk.fit.measurements import translations
from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import robot_to_dict
from edtk.system.errors import ArgumentError, UserError

K = STUDY.compliances


def found(**given):
    """Detections for the published plan of twelve."""
    return powers(STUDY, PLAN, given)


def powers(study, plan, given):
    """Detections for a plan."""
    return detect(Promised.displacements(study, plan), sized_faults(study, given))[0]


def scene(study, data):
    """What faults change."""
    return Displacements(study.model, data, data.regressor(study.model), K)


def test_power_is_the_share_of_simulations_that_show_it():
    """Of 4000 simulated sheets with the drift, the test notices the share that is promised."""
    (promised,) = found(drift="0.04mm")
    data = planned_measurements(STUDY, PLAN)
    fault = next(f for f in families(scene(STUDY, data)) if f.cause == "drift")
    A = data.regressor(STUDY.model)
    D = fault.derivative_at_zero(K)
    rng = np.random.default_rng(0)
    shifts = D @ np.full(3, 0.04e-3 / np.sqrt(3))
    measured = A @ K + shifts + data.sigma * rng.standard_normal((4000, *data.sigma.shape))
    names = STUDY.model.parameters
    without = Whitened.of(A, data.sigma, names)
    columns = np.concatenate([A, D], axis=-1)
    with_it = Whitened.of(columns, data.sigma, (*names, "x", "y", "z"))
    drop = (with_it.project(measured) ** 2).sum(axis=1) - (without.project(measured) ** 2).sum(
        axis=1
    )
    noticed = (drop > chi_square_quantile(0.99, 3)).mean()
    assert 0.1 < promised.power < 0.9
    # Binomial: four standard errors of 4000 are 3 %.
    assert noticed == pytest.approx(promised.power, abs=0.03)


def test_one_more_experiment_helps():
    """The named experiment raises the chance, and is within the joint limits."""
    (promised,) = found(tool_z="10mm")
    assert promised.power_with > promised.power
    lower, upper = STUDY.robot.limits
    assert ((lower <= promised.better) & (promised.better <= upper)).all()
    assert promised.to_dict()["better_q"] == promised.better.tolist()


def test_a_load_of_another_size_is_never_seen():
    """Compliances take up the size of the load, whatever the plan."""
    (promised,) = found(load="10%")
    assert promised.fault == "load_size"
    assert promised.power == promised.power_with == 0.01
    assert promised.better is None


def test_the_joint_in_which_it_is_hardest_to_see_is_named():
    """Backlash is judged in the joint that shows it least."""
    (promised,) = found(backlash="0.01deg")
    assert promised.joint in STUDY.robot.joint_names


@pytest.mark.parametrize(
    ("name", "small", "large"),
    [
        ("joint_zero", "0.1deg", "30deg"),
        ("friction", "1Nm", "1000Nm"),
        ("link_length", "1mm", "800mm"),
    ],
)
def test_faults_of_one_joint_are_noticed_by_their_size(name, small, large):
    """Chances of zeros, friction and links grow with their size, in the units of the help."""
    powers = [found(**{name: size})[0].power for size in (small, large)]
    assert powers[0] < 0.2 < 0.9 < powers[1]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"tool_z": "5deg"}, "tool_z=5deg: expected a number with its unit, mm"),
        ({"tool_z": "mm"}, "expected a number with its unit, mm"),
        ({"tool_z": "nanmm"}, "expected a number with its unit, mm"),
        ({"wind": "5mm"}, "no fault 'wind'; expected one of load_size"),
    ],
)
def test_what_cannot_be_meant(given, words):
    """A fault or a unit that is not known is one line."""
    with pytest.raises(ArgumentError) as error:
        sized_faults(STUDY, given)
    assert words in str(error.value)


def test_without_assumed_compliances():
    """Faults are judged by the compliances of [simulation]."""
    with pytest.raises(UserError, match="simulation"):
        sized_faults(STUDY.replace(simulation=None), {"drift": "1mm"})


def test_a_known_joint_shows_the_size_of_the_load():
    """Where the compliance of a joint is known, a load of another size leaves residuals."""
    joints = STUDY.specification.joints.model_dump()
    known = {"unknown": joints["unknown"][1:], "known_rad_per_Nm": {"q2": float(K[0])}}
    study = STUDY.replace(joints=joints | known)
    (promised,) = powers(study, PLAN, {"load": "10%"})
    data = planned_measurements(study, PLAN)
    whitened = Whitened.of(data.regressor(study.model), data.sigma, study.model.parameters)
    first = data.regressor(STUDY.model)[..., 0] * K[0]
    seen = (whitened.residual(0.1 * first) ** 2).sum()
    threshold = chi_square_quantile(0.99, 1)
    normal = np.random.default_rng(0).standard_normal(100_000)
    assert promised.power == pytest.approx(
        ((normal + np.sqrt(seen)) ** 2 > threshold).mean(), abs=0.01
    )


MARKED = {
    "marker": [{"position_mm": [0, 100, 50]}, {"joint": "q4", "position_mm": [-300, 50, 100]}],
}
INSTRUMENTS = {
    "markers": MARKED,
    "distances": {"distance": [{"anchor_mm": [3000, 0, 0]}, {"anchor_mm": [0, 3000, 500]}]},
    "mix": MARKED | {"distance": [{"anchor_mm": [3000, 0, 0]}]},
    "payload beside the load": {"payload": {"mass_kg": 100}},
    "visits": MARKED
    | {
        "noise": {
            "tracker_position_mm": [4000, -3000, 1200],
            "along": [10, 5],
            "across": [15, 6],
            "repeatability_deg": 0.001,
        }
    },
}


@pytest.mark.parametrize("keys", INSTRUMENTS.values(), ids=INSTRUMENTS)
def test_any_instruments_show_faults(keys):
    """The power is that of the noncentral chi-square of what fits of the readings leave."""
    study = STUDY.replace(**keys)
    plan = Plan(PLAN.q, PLAN.wrench, PLAN.repeats)
    promised = powers(study, plan, {"drift": "0.05mm", "load": "20%"})
    data = planned_measurements(study, plan)
    A = data.regressor(study.model)
    whitened = Whitened.of(A, data.noise, study.model.parameters)
    drift = translations(study.model, data) @ np.full(3, 0.05e-3 / np.sqrt(3))
    heavier = replace(data, wrench=1.2 * data.wrench).regressor(study.model) @ K - A @ K
    for change, dims, found in zip((drift, heavier), (3, 1), promised, strict=True):
        seen = (whitened.residual(change) ** 2).sum()
        power = 1 - chndtr(chi_square_quantile(0.99, dims), dims, seen)
        assert found.power == pytest.approx(power, rel=1e-6)
        assert found.power_with >= found.power
    assert (promised[1].power > 0.011) == ("payload" in keys)
    assert promised[0].better is not None


@pytest.mark.parametrize("keys", [MARKED, INSTRUMENTS["mix"]], ids=["markers", "mix"])
@pytest.mark.parametrize("reference", ["unloaded", "nominal"])
def test_a_turned_frame_turns_what_instruments_show(keys, reference):
    """The derivative is that of turned readings: all of a position, but no distance."""
    content = robot_to_dict(load_robot("kuka_kr270"))
    for joint in content["joints"]:
        joint |= {"mass_kg": 100.0, "center_m": [0.1, 0, 0]}
    measurement = {"sigma_mm": 0.03, "reference": reference}
    study = STUDY.replace(**keys, robot=content, measurement=measurement)
    data = planned_measurements(study, Plan(PLAN.q, PLAN.wrench, PLAN.repeats))
    every = families(scene(study, data))
    frame = next(one for one in every if one.cause == "frame_rotation")
    D = frame.derivative_at_zero(K)
    frames = study.model.frames(PLAN.q)
    bent = np.moveaxis(study.model.regressor_of(frames, PLAN.wrench), (0, 1), (-1, -2)) @ K
    shown = bent[:, :6].reshape(-1, 2, 3)
    if reference == "nominal":
        shown = shown + np.moveaxis(study.model.points_of(frames)[:2], -1, 0)
    turned = np.stack([np.cross(axis, shown) for axis in np.eye(3)], axis=-1)
    expected = np.zeros((len(PLAN.q), bent.shape[1], 3))
    expected[:, :6] = turned.reshape(-1, 6, 3)
    np.testing.assert_allclose(D.reshape(expected.shape), expected, atol=1e-9)


def test_faults_that_nobody_overlooks():
    """A fault of any size is noticed with at most one; the chance is always a number."""
    (promised,) = found(tool_z="1e12mm")
    assert promised.power == 1

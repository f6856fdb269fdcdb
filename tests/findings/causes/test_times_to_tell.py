"""Repetitions after which two faults are told apart."""

from dataclasses import replace

import numpy as np
import pytest
from readings import STUDY

from edtk.calibration.planned import planned_measurements
from edtk.design.plan import Plan
from edtk.findings.causes.family import Cause, Tried
from edtk.findings.causes.faults import families
from edtk.findings.causes.find_causes import times_to_tell
from edtk.findings.causes.try_faults import PlainFit

MODEL = STUDY.model
POSES = np.random.default_rng(3).uniform(*MODEL.robot.limits, size=(12, 6))
WRENCH = np.tile([0, 0, -2500.0, 0, 0, 0], (len(POSES), 1))


def plain(repeats):
    """Good measurements without noise."""
    times = np.full(len(POSES), repeats)
    data = planned_measurements(STUDY, Plan(POSES, WRENCH, times))
    measured = data.regressor(MODEL) @ STUDY.compliances
    return PlainFit.of(MODEL, replace(data, deflection=measured), measured, {}, None)


def tried(fit, cause, size):
    """A fault of a size."""
    every = families(fit.scene)
    family = next(one for one in every if one.cause == cause)
    return Tried(Cause(cause, 1.0, "", None, 0.0), 0.0, 1, 1, 0.0, family, np.array(size))


def test_times_fall_as_repetitions_add_up():
    """What needs n repetitions needs half of them where each is made twice; a larger fault, less.

    The distance of two predictions grows as the root of the number of repetitions.
    """
    once, twice = plain(1), plain(2)
    needed = [
        times_to_tell(tried(fit, "tool_z", [size]), tried(fit, "drift", [0.0] * 3), fit)
        for fit, size in ((once, 0.0015), (twice, 0.0015), (once, 0.003))
    ]
    assert needed[0] > 8
    assert needed[1] == pytest.approx(needed[0] / 2, abs=1)
    assert needed[2] == pytest.approx(needed[0] / 4, abs=1)


def test_what_is_never_told():
    """The same fault, one of single rows, and one that the other imitates in full."""
    fit = plain(1)
    drift = tried(fit, "drift", [5e-5, 0, 0])
    pose = Tried(Cause("pose", 1.0, "mm", None, 0.0), 0.0, 3, 1)
    assert times_to_tell(drift, drift, fit) is None
    assert times_to_tell(drift, pose, fit) is None
    assert times_to_tell(pose, drift, fit) is None
    assert times_to_tell(drift, replace(drift, size=np.zeros(3)), fit) is None
    far = tried(fit, "drift", [1.0, 0, 0])
    assert times_to_tell(far, tried(fit, "tool_z", [0.0]), fit) == 1

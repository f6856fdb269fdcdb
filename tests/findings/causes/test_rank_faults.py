"""Faults that may explain residuals are told from those that chance makes, and put in order."""

import math

import numpy as np
import pytest

from edtk.findings.causes.family import NOISE, Cause, Family, Tried
from edtk.findings.causes.try_faults import (
    ALWAYS,
    COMMON,
    LEVEL,
    OTHERS,
    likely_faults,
    rank_faults,
)


def tried(cause, p=1e-3, deviance=0.0, tries=1.0, joint=""):
    """A fault of one parameter that costs nothing but its tries."""
    return Tried(Cause(cause, 1.0, "", None, p, joint=joint), deviance, 1, tries, 0.0)


def names(found):
    """Causes."""
    return [one.cause.cause for one in found]


def test_any_cause_is_likely_in_few_good_data():
    """The shares of the level that all tests have are no more than 1.5 times the level."""
    assert sum(1 / share for share in ALWAYS.values()) + 1 / OTHERS < 1.5


def test_each_cause_has_the_same_share():
    """Many joints share the level of their cause, and not that of others."""
    joints = [tried("backlash", p=0.5, tries=6) for _ in range(6)]
    drift = tried("drift", p=0.9 * LEVEL / (2 * OTHERS))
    assert names(likely_faults([*joints, drift])) == ["drift"]
    assert likely_faults([*joints, tried("drift", p=1.1 * LEVEL / (2 * OTHERS))]) == []
    alone = tried("backlash", p=0.9 * LEVEL / (2 * 6 * OTHERS), tries=6)
    assert names(likely_faults([*joints, alone, tried("drift", p=1)])) == ["backlash"]


def test_one_that_is_no_chance_brings_in_the_others():
    """Noise that is too large lets a drift compete that is likely by itself; p is the larger."""
    noise = tried(NOISE, p=1e-3)
    drift = tried("drift", p=LEVEL / 2)
    assert likely_faults([tried(NOISE, p=LEVEL), drift, tried("tool_z", p=1)]) == []
    found = likely_faults([noise, drift, tried("tool_z", p=1)])
    assert names(found) == [NOISE, "drift"]
    assert [one.cause.p for one in found] == [ALWAYS[NOISE] * 1e-3, LEVEL / 2]
    assert likely_faults([tried(COMMON, p=LEVEL / 5), drift, tried("tool_z", p=1)]) == []
    assert likely_faults([]) == []


def test_a_fault_whose_size_may_be_zero_explains_nothing():
    """A joint that hardly gives way fits anything at a size that no gear has."""

    def nothing(c):
        return np.zeros((3, 1, 1)), np.zeros((3, 1))

    family = Family("torque_sign", "%", 100.0, 1, 0.15, nothing, 6, "q4")
    found = []
    for size, std in ((6e-5, 21.0), (-25.0, 4.0)):
        cause = Cause("torque_sign", size, "%", std, 1e-6, joint="q4")
        found.append(Tried(cause, -40.0, 1, 6, 0.0, family, np.array([size / 100])))
    assert likely_faults([*found, tried(NOISE, p=1e-6)])[0].cause.size == -25.0
    assert names(likely_faults([found[0], tried(NOISE, p=1e-6)])) == [NOISE]


def test_a_cause_is_as_likely_as_its_joints_together():
    """Two joints that are about as good are better than a single fault that is a bit better."""
    found = [
        tried("backlash", deviance=-10.0, joint="q2", tries=2),
        tried("backlash", deviance=-9.5, joint="q3", tries=2),
        tried("drift", deviance=-9.5),
    ]
    (score, best), (second, other), (third, last) = rank_faults(found, 36)
    assert (best.cause.joint, other.cause.cause, last.cause.joint) == ("q2", "drift", "q3")
    assert score == pytest.approx(-10 - 2 * math.log((1 + math.exp(-0.25)) / 2))
    assert second == -9.5
    assert third == pytest.approx(-9.5 + 2 * math.log(2))


def test_no_overflow():
    """Deviances of gross faults are far apart."""
    ranked = rank_faults([tried("drift", deviance=0.0), tried("drift", deviance=-1e6)], 36)
    assert ranked[0][0] == -1e6

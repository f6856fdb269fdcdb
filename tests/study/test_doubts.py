"""What looks wrong in measurements is said in a line each, and nothing where nothing is wrong."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from edtk.design import Plan
from edtk.inference import simulate
from edtk.inference.identify import identify
from edtk.inference.measurements import Measurements
from edtk.study import load_study
from edtk.study.doubts import doubts

ROOT = Path(__file__).parents[2]
STUDY = load_study(ROOT / "studies" / "kr270_milling.toml")
PLAN = STUDY.published_plans()["table_4_12"]


@pytest.fixture(scope="module")
def unassuming(tmp_path_factory):
    """The study without assumed true compliances."""
    text = (ROOT / "studies/kr270_milling.toml").read_text()
    text = text[: text.index("published = [")] + text[text.index("[tool]") : text.index("[simulation]")]
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_text(text)
    return load_study(path)


def measured(seed=0, repeats=2, digits=4):
    """Simulated readings of the plan, each to so many digits of a millimetre."""
    q, W = np.repeat(PLAN.q, repeats, axis=0), np.repeat(PLAN.wrench, repeats, axis=0)
    moved = simulate(STUDY.model.regressor(q, W), STUDY.compliances, STUDY.sigma, np.random.default_rng(seed))[0]
    return Measurements(q, W, moved.round(digits + 3), np.tile(STUDY.sigma, (len(q), 1)), np.zeros((len(q), 3)))


def lines(data, study=STUDY, plan=None, known=True):
    A = data.regressor(study.model)
    return doubts(study, data, A, identify(A, data.deflection, data.sigma, study.model.parameters, known=known), plan)


def test_nothing_wrong(unassuming):
    """Clean measurements raise no doubts in nineteen runs of twenty, and more."""
    found = [lines(measured(seed), study, PLAN) for seed in range(40) for study in (STUDY, unassuming)]
    assert sum(map(bool, found)) <= 2


@pytest.mark.parametrize(("factor", "named"), [(1e-3, "in metres"), (1e3, "in micrometres")])
@pytest.mark.parametrize("known", [False, True])
def test_units(unassuming, factor, named, known):
    """Displacements a thousand times off are noticed, with assumed compliances and without."""
    data = measured()
    data = replace(data, deflection=data.deflection * factor)
    for study in (STUDY, unassuming):
        (line,) = lines(data, study, known=known)
        assert named in line
        assert "expected millimetres" in line


def test_radians():
    """Angles given in radians where degrees are expected are noticed."""
    data = measured()
    data = replace(data, q=np.deg2rad(data.q))
    assert any("radians" in line and "joint angles" in line for line in lines(data))


def test_swapped_positions():
    """Displacements of the wrong sign make every compliance negative, which is said instead of each by name."""
    data = measured()
    found = lines(replace(data, deflection=-data.deflection))
    assert "swapped" in found[0]
    assert "k2" not in found[0]


def test_a_negative_compliance_is_named():
    """A compliance that comes out negative is named with its estimate."""
    data = measured()
    A = data.regressor(STUDY.model)
    data = replace(data, deflection=data.deflection - A[..., 3] * 1.1 * STUDY.compliances[3])
    (line,) = lines(data)
    assert line.startswith("k5 = -")
    assert "negative" in line


def test_poses_that_were_not_measured():
    """Planned poses without a measurement are named."""
    data = measured(repeats=1)
    assert lines(data, plan=PLAN) == ()
    other = data.q.copy()
    other[[2, 5]] += np.deg2rad(1)
    found = lines(data, plan=Plan(other, data.wrench, np.ones(12, dtype=int)))
    assert found == ("poses 3, 6 of the plan: not measured",)


@pytest.mark.parametrize(("factor", "why"), [(3, "sigma is too small"), (1 / 3, "sigma is too large")])
def test_sigma_that_the_residuals_contradict(factor, why):
    """Residuals far larger or smaller than sigma are said so, and not where sigma is estimated."""
    data = measured()
    A = data.regressor(STUDY.model)
    clean = A @ STUDY.compliances
    data = replace(data, deflection=clean + factor * (data.deflection - clean))
    (line,) = lines(data)
    assert why in line
    assert lines(data, known=False) == ()

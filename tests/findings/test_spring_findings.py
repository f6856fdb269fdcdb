"""What looks wrong in measurements is said in a line each, and nothing where nothing is wrong."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from readings import PLAN, STUDY, measured, readings_of
from scipy.spatial.transform import Rotation
from scipy.stats import binom

from edtk.design.candidate_source import sample_feasible
from edtk.design.plan import Plan
from edtk.findings.finding import Severity
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.findings.noise import UNLIKELY_NOISE
from edtk.findings.springs import spring_findings
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import Measurements, simulate
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.study.study import load_study

NOTE, WARNING, ALARM = Severity

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def unassuming(tmp_path_factory):
    """The study without assumed true compliances."""
    text = (ROOT / "studies/kr270_milling.toml").read_text()
    text = (
        text[: text.index("published = [")]
        + text[text.index("[tool]") : text.index("[simulation]")]
    )
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_text(text)
    return load_study(path)


def found(data, study=STUDY, plan=None, known=True, robust=False):
    return spring_findings(
        FittedData.of(study, data, HowFitted(plan=plan, robust=robust, sigma_unknown=not known))
    )


def lines(data, *args, **options):
    return tuple(diagnostic.words for diagnostic in found(data, *args, **options))


@pytest.mark.slow
def test_nothing_wrong(unassuming):
    """Clean measurements raise doubts in so few runs as happen to, where one of twenty does."""
    runs = 20
    doubted = sum(
        any(lines(measured(seed), study, PLAN) for study in (STUDY, unassuming))
        for seed in range(runs)
    )
    # But for one sample of a thousand.
    assert binom.sf(doubted - 1, runs, 0.05) > 1e-3


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


@pytest.mark.parametrize("factor", [1 / 25.4, 0.1])
def test_inches_and_centimetres(unassuming, factor):
    """A noise far below the stated one is an alarm, as everything scales with the unit."""
    data = measured()
    data = replace(data, deflection=data.deflection * factor)
    (diagnostic,) = [d for d in found(data, unassuming, known=False) if "another unit" in d.words]
    assert diagnostic.severity == ALARM


def test_radians():
    """Angles given in radians where degrees are expected are noticed."""
    data = measured()
    data = replace(data, q=np.deg2rad(data.q))
    assert any("radians" in line and "joint angles" in line for line in lines(data))


def test_swapped_positions():
    """Displacements of the wrong sign are said once, instead of each compliance by name."""
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
    assert line.startswith("k5 comes out as -")
    assert "far below zero" in line


def test_poses_that_were_not_measured():
    """Planned poses without a measurement are named."""
    data = measured(repeats=1)
    assert lines(data, plan=PLAN) == ()
    other = data.q.copy()
    other[[2, 5]] += np.deg2rad(1)
    found = lines(data, plan=Plan(other, data.wrench, np.ones(12, dtype=int)))
    assert found[0].startswith("row 3, column q5_deg: the pose is not in the plan")
    assert found[1:] == ("rows 3, 6 of the plan: not measured",)


@pytest.mark.parametrize(
    ("factor", "why"), [(3, "sigma is too small"), (1 / 3, "sigma is too large")]
)
def test_sigma_that_the_residuals_contradict(factor, why):
    """Residuals far larger or smaller than sigma are said so, and not where sigma is estimated."""
    data = measured()
    A = data.regressor(STUDY.model)
    clean = A @ STUDY.compliances
    data = replace(data, deflection=clean + factor * (data.deflection - clean))
    (line,) = lines(data)
    assert why in line
    silent = lines(data, known=False)
    assert not silent if factor < 1 else "the noise is estimated as" in silent[0]
    (diagnostic,) = [d for d in found(data, robust=True) if not d.words.startswith("row")]
    assert why in diagnostic.words
    assert diagnostic.severity == (ALARM if factor > 1 else WARNING)


def test_a_wrong_tool_is_never_good():
    """A tool that is 100 mm longer is found in every kind of fit; an alarm where sigma counts."""
    data = measured()
    tool = STUDY.specification.tool.build()
    tool[:3, 3] += tool[:3, :3] @ [0, 0, 0.1]
    other = ElastostaticModel(STUDY.robot.with_tool(tool), STUDY.model.joints)
    A = other.regressor(data.q, data.wrench)
    moved = simulate(A, STUDY.compliances, STUDY.sigma, np.random.default_rng(1))[0]
    data = replace(data, deflection=moved)
    for robust in (False, True):
        assert max(d.severity for d in found(data, robust=robust)) == ALARM
        assert max(d.severity for d in found(data, robust=robust, known=False)) >= WARNING


@pytest.mark.parametrize(
    ("factor", "named", "severity"),
    [
        (1e-3, "kilonewtons", ALARM),
        (1 / 9.81, "kilograms", ALARM),
        (1 / 4.448, "pounds", ALARM),
        (1e3, "millinewtons", ALARM),
        (2, "newtons", WARNING),
        (1.1, None, NOTE),
    ],
)
def test_forces_in_another_unit(factor, named, severity):
    """Forces that are not the expected ones are named before the displacements are blamed."""
    data = measured()
    data = replace(data, wrench=data.wrench * factor)
    for plan in (None, PLAN):
        texts = [d for d in found(data, plan=plan) if "forces" in d.words]
        assert bool(texts) == (named is not None)
        if named:
            assert named in texts[0].words
            assert texts[0].severity == severity
            assert not any("displacements" in line for line in lines(data, plan=plan))


def _two_loads():
    """A plan of three poses under two loads each, the second repeated, and its measurements."""
    q = np.repeat(PLAN.q[:6:2], 2, axis=0)
    W = np.tile([[0, 0, -2500, 0, 0, 0], [700, 0, 0, 0, 0, 0.0]], (3, 1))
    plan = Plan(q, W, np.tile([1, 4], 3))
    each = np.repeat(np.arange(6), plan.repeats)
    return plan, readings_of(q[each], W[each], seed=3)


def test_the_load_is_part_of_an_experiment():
    """Loads are compared with those planned in the same pose; a missing or another one is named."""
    plan, data = _two_loads()
    assert not [line for line in lines(data, plan=plan) if "plan" in line or "forces" in line]
    some = np.flatnonzero(np.arange(len(data)) != 5)
    assert "row 3 of the plan: not measured" in lines(data[some], plan=plan)
    wrench = data.wrench.copy()
    wrench[7] = [700, 0, -2200, 0, 0, 0]
    (line,) = [line for line in lines(replace(data, wrench=wrench), plan=plan) if "load" in line]
    assert line.startswith("row 8: the load is not the one planned in this pose")


def test_loads_of_one_direction():
    """Two sizes of load are told apart, and a length in metres is found beside another load."""
    q = np.repeat(PLAN.q[:6], 2, axis=0)
    W = np.tile([[0, 0, -1000.0, 0, 0, 0], [0, 0, -2500.0, 0, 0, 0]], (6, 1))
    plan = Plan(q, W, np.ones(12, dtype=int))
    data = readings_of(q, W, seed=4)
    data = replace(data, q=q.round(5), wrench=1.02 * W)
    assert not [line for line in lines(data, plan=plan) if "plan" in line or "forces" in line]
    other = data.wrench.copy()
    other[3] *= 1.3
    text = lines(replace(data, wrench=other, deflection=data.deflection / 1e3), plan=plan)
    assert any("row 4: the load is not the one planned" in line for line in text)
    assert any("in metres" in line for line in text)


def test_a_warning_of_forces_hides_no_alarm():
    """With forces off by two a gross error is still an alarm."""
    data = measured()
    deflection = data.deflection.copy()
    deflection[3, 2] += 0.01
    severities = {
        d.severity for d in found(replace(data, deflection=deflection, wrench=2 * data.wrench))
    }
    assert severities >= {WARNING, ALARM}


def test_coarse_readings_that_are_the_same():
    """Equal rows that may be so by chance are no mistake, but a note names the first of them."""
    data = measured(digits=1)
    data.deflection[7] = data.deflection[6]
    (note,) = [d for d in found(data, known=False) if "to the last digit" in d.words]
    assert note.severity == NOTE
    assert note.words.startswith("row ")


def test_what_cannot_be_told_from_zero():
    """A stiff joint is no alarm: its compliance is said to be as good as zero."""
    data = measured(repeats=1)
    k = STUDY.compliances * [1, 1, 1, 1, 1e-3]
    A = data.regressor(STUDY.model)
    told = 0
    for seed in range(20):
        moved = simulate(A, k, STUDY.sigma, np.random.default_rng(seed))[0]
        of_it = [d for d in found(replace(data, deflection=moved)) if "k6" in d.words]
        told += any("k6 can hardly be told from zero" in d.words for d in of_it)
        assert all(d.severity <= WARNING for d in of_it)
    assert told >= 17


def test_too_many_outliers():
    """One outlier is a warning; a third of all rows are an alarm."""
    data = measured()
    moved = data.deflection.copy()
    moved[3] += 1e-3
    assert any(
        "row 4: outlier, 1.7 mm off; the other rows fit without it (p = " in d.words
        and d.severity == WARNING
        for d in found(replace(data, deflection=moved))
    )
    moved[::2] += np.random.default_rng(0).normal(size=(12, 3)) * 1e-3
    doubted = found(replace(data, deflection=moved), robust=True)
    assert any("outliers" in d.words and d.severity == ALARM for d in doubted)


def _alone(plan):
    """The notes on parameters that rest on single poses, of a plan measured once."""
    data = readings_of(plan.q, plan.wrench)
    notes = [d for d in found(data) if d.kind == "one_pose"]
    assert {d.severity for d in notes} <= {NOTE}
    return data, notes


def test_a_parameter_that_rests_on_one_pose():
    """Of a plan of few poses it is noted which pose a parameter hangs on, and by how much.

    Left out, that pose makes those parameters five times as uncertain or more, and no others so.
    """
    data, (note,) = _alone(STUDY.load_plan(ROOT / "paper_figures/own_plans/true_m3.csv"))
    A = FittedData.of(STUDY, data).A  # of the loaded equilibrium
    names = STUDY.model.parameters
    std = estimate(A, data.deflection, data.sigma, names).std
    (pose,) = note.rows
    rest = np.delete(np.arange(3), pose)
    without = estimate(A[rest], data.deflection[rest], data.sigma[rest], names).std
    hanging = {name for name, ratio in zip(names, without / std, strict=True) if ratio >= 5}
    assert set(note.data["parameters"]) == hanging
    assert note.data["times"] == pytest.approx((without / std)[without / std >= 5].min())
    assert f"only one pose tells enough (row {pose + 1}); without that pose the stand" in note.words


def test_parameters_that_rest_on_each_of_two_poses():
    """Of two poses it is noted once that both are needed, which lowers no verdict."""
    _, (note,) = _alone(STUDY.published_plans()["table_4_2"])
    assert note.data["parameters"] == STUDY.model.parameters
    assert (
        "only 2 poses tell enough (rows 1, 2), and each is needed; without one of them the v"
        in (note.words)
    )
    assert _alone(STUDY.published_plans()["table_4_3"])[1] == []
    assert _alone(PLAN)[1] == []


def test_nothing_left_to_judge_by():
    """With as many coordinates as parameters, no residual tells whether anything is wrong."""
    data = measured(repeats=1)
    two = Measurements(
        data.q[:2], data.wrench[:2], data.deflection[:2], data.sigma[:2], data.marker[:2]
    )
    study = load_study(ROOT / "studies/kr270_six_compliances.toml")
    (diagnostic,) = [d for d in _of_six(study, two) if "no residual tells" in d.words]
    assert diagnostic.severity == WARNING


def _of_six(study, two):
    """Two measurements, for six compliances."""
    wrench = np.array([[1000.0, 800, -2000, 0, 0, 0], [-900, 1500, -2500, 0, 0, 0]])
    data = replace(two, wrench=wrench)
    A = data.regressor(study.model)
    return found(replace(data, deflection=A @ study.compliances), study)


def test_beyond_the_limits():
    """A pose beyond a joint's limits is named with row, column and limits."""
    data = measured()
    q = data.q.copy()
    q[4, 2] = np.deg2rad(300)
    assert any(
        "row 5, column q3_deg: 300 is beyond the joint's limits" in line
        for line in lines(replace(data, q=q))
    )


def test_too_few_for_a_robust_scale():
    """Of few coordinates a robust fit that estimates sigma is one of least squares, which is said.

    That holds for the fit of the loaded equilibrium, too.
    """
    few = measured()[:3]
    for linear in (False, True):
        fitted = FittedData.of(
            STUDY, few, HowFitted(robust=True, sigma_unknown=True, linear=linear)
        )
        assert fitted.nonlinear != linear
        (line,) = (d.words for d in spring_findings(fitted) if d.kind == "too_few_for_robust")
        assert line.startswith("9 measured coordinates for 5 parameters are too few for a robust")
    assert not any("too few" in line for line in lines(few, robust=True))


def test_noise_that_repetitions_share():
    """Noise of which repetitions of a pose share a half is found, and used, and no alarm."""
    rng = np.random.default_rng(5)
    data = measured(repeats=4)
    common = np.repeat(STUDY.sigma * rng.standard_normal((len(PLAN.q), 3)), 4, axis=0)
    data = replace(data, deflection=data.deflection + common)
    fitted = FittedData.of(STUDY, data, HowFitted(plan=PLAN))
    assert fitted.common_noise
    found = spring_findings(fitted)
    assert [d.severity for d in found] == [WARNING]
    assert "that they share is an error of the model, and counts in tasks" in found[0].words
    alone = FittedData.of(STUDY, measured(repeats=4), HowFitted(plan=PLAN))
    # Means of four have the variance 1/4 + 1 instead of 1/4: standard deviations grow by sqrt(5).
    assert (fitted.fit.std / alone.fit.std).mean() == pytest.approx(np.sqrt(5), rel=0.25)


@pytest.mark.parametrize(("size", "severity"), [(2.0, WARNING), (40.0, ALARM)])
def test_too_much_is_no_noise(size, severity):
    """What repetitions share is a doubt where noise may be so large, and an alarm beyond."""
    data = measured(repeats=4)
    shared = np.random.default_rng(3).standard_normal((len(data) // 4, 3))
    moved = data.deflection + np.repeat(size * STUDY.sigma * shared, 4, axis=0)
    told = found(replace(data, deflection=moved))
    (one,) = [d for d in told if d.kind == "lack_of_fit"]
    assert one.severity is severity
    assert ("too much for noise" in one.words) is (severity is ALARM)


def turned_load(seed, deg):
    """Readings of twelve poses under a load that is turned by some degrees about each axis."""
    u = sample_feasible(STUDY.space, 12, (seed, 1))
    q, wrench = u[:, : STUDY.robot.n], np.array(STUDY.space.load.wrench(u[:, STUDY.robot.n :]))
    R = Rotation.from_rotvec(np.deg2rad(deg) * np.random.default_rng(seed).standard_normal(3))
    acts = np.hstack([R.apply(wrench[:, :3]), R.apply(wrench[:, 3:])])
    return replace(readings_of(q, acts, seed), wrench=wrench)


def test_a_load_as_uncertain_as_stated_is_no_fault():
    """A load that is turned as the study doubts makes no result bad; one turned by far is said.

    What is left beside what the study doubts has uniform probabilities.
    """
    stated = STUDY.specification.uncertainty.load_direction_deg
    as_doubted = [FittedData.of(STUDY, turned_load(seed, stated)) for seed in range(12)]
    assert min(one.as_doubted for one in as_doubted) > UNLIKELY_NOISE / 12
    assert 0.25 < np.mean([one.as_doubted for one in as_doubted]) < 0.75
    counted = [one for one in as_doubted if one.as_doubted > UNLIKELY_NOISE]
    assert any(one.fit.scale > 1.5 for one in counted)
    worst = [said.severity for one in counted for said in spring_findings(one)]
    assert ALARM not in worst
    far = FittedData.of(STUDY, turned_load(3, 10 * stated))
    assert far.as_doubted < 1e-9
    assert any(one.severity == ALARM for one in spring_findings(far))

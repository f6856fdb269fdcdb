"""Known values and priors of parameters of any kind: laws that hold for geometry and springs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from arm import ROBOT as PLANAR_ROBOT
from geometry_sheets import OFFSETS, PLACE, ROBOT, Array, by_pose
from scipy.stats import norm

import edtk
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.geometry_space import PositionRows
from edtk.calibration.told_before import told_before
from edtk.design.plan import Plan
from edtk.findings.geometric_fit import geometric_findings
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.fitted_geometry import GeometricFit, resting_load
from edtk.fit.geometry_posterior import GeometryDensity
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.prior import Gaussian, Prior, fit_with_prior
from edtk.measure.measured_model import MeasuredModel
from edtk.robots.frames import MM
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.errors import UserError

SIGMA = 0.02  # mm
LOAD = (100.0, 50.0, -300.0, 0.0, 0.0, 0.0)
SOFT = {"q2": 3e-6, "q3": 5e-6}


def study_of(prior: dict | None = None, **keys: object) -> Study:
    """A study of the small arm with three markers."""
    parameters = {"compliance": [], "geometry": "all", "base": True, "tool": True}
    given = {
        "robot": ROBOT,
        "measurement": {"sigma_mm": SIGMA},
        "parameters": parameters,
        "marker": [
            {"name": name, "position_mm": (1e3 * place).tolist()}
            for name, place in zip("ABC", OFFSETS, strict=True)
        ],
    }
    return Study(**given | ({} if prior is None else {"prior": prior}) | keys)


def springs_of(prior: dict | None = None, **keys: object) -> Study:
    """The smallest one: springs alone, of a robot whose geometry is that of the drawing."""
    joints = {"unknown": list(SOFT)}
    parameters = {"geometry": [], "base": False, "tool": False}
    load = {"F_N": list(LOAD[:3])}
    return study_of(prior, **{"joints": joints, "parameters": parameters, "load": load} | keys)


def day(
    study: Study, poses: int, seed: int, theta: dict[str, float], spread: float = 0.0
) -> tuple[MarkerPositions, MeasuredModel, Array]:
    """Positions of an erring robot, half of the visits loaded; the true model and parameters."""
    rng = np.random.default_rng(seed)
    setting = StudyGeometry.of(study)
    placed = study.kind.parameters(study).base
    model = replace(setting.model, start=PLACE if placed else np.eye(4))
    true = rng.normal(0, spread, model.p) * model.scales
    for i, one in enumerate(model.parameters):
        true[i] = theta.get(one.name, true[i])
    q = rng.uniform(-1.7, 1.7, (poses, 6))
    wrench = np.zeros((poses, 6))
    if setting.loads is not None:
        wrench[::2] = LOAD
    torque = None if setting.loads is None else setting.loads(q, wrench)
    x = model.see(true, q, torque, derivatives=False).points
    x = x + rng.normal(0, SIGMA / MM, x.shape)
    row = np.arange(poses)[:, None] * np.ones(3, dtype=int)
    return MarkerPositions(q, wrench, x, row, setting.markers), model, true


def fitted(study: Study, data: MarkerPositions) -> GeometricFit:
    """The fit of a day."""
    setting = StudyGeometry.of(study)
    return fit_geometry(
        setting.model, data, setting.noise, setting.loads, prior=told_before(setting)
    )


def exact_posterior(fit: GeometricFit, data: MarkerPositions, study: Study) -> tuple[Array, Array]:
    """Mean and covariance of the Gaussian posterior of the model that is linear about a fit.

    By information matrices, in the units of the parameters.
    """
    setting = StudyGeometry.of(study)
    model = fit.fitted.model
    torque = fit.fitted.torque(data.q, data.wrench, setting.loads)
    seen = model.see(fit.fitted.theta, data.q, torque)
    J = MM * (seen.jacobian * model.scales).reshape(-1, model.p)
    z = MM * (data.measured - seen.points).ravel() + J @ fit.fitted.values
    P, h = fit.told_before.prior.gaussian()
    P, h = P * np.outer(model.scales, model.scales), h * model.scales
    covariance = np.linalg.inv(J.T @ J / SIGMA**2 + P)
    return covariance @ (J.T @ z / SIGMA**2 + h), covariance


def test_a_fit_is_the_gaussian_posterior() -> None:
    """Where errors are white and of the stated size, mean and covariance are Bayes's."""
    prior = {"parameters": {"zeros": {"std_mrad": 0.3}, "tilts": {"std_mrad": 0.5, "mean_mrad": 1}}}
    study = study_of(prior)
    data, _, _ = day(study, 16, 3, {}, spread=0.4)
    fit = fitted(study, data)
    assert fit.fitted.noise.model_fit is None  # else the size of the errors is another one
    mean, covariance = exact_posterior(fit, data, study)
    std = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(fit.fitted.values / std, mean / std, rtol=0, atol=1e-5)
    np.testing.assert_allclose(fit.fitted.std, std, rtol=1e-7)


def test_springs_alone_are_the_fit_of_displacements() -> None:
    """A prior of springs counts in a study with [parameters] as in one of displacements."""
    mean = {"q2": 2.5e-6, "q3": 6e-6}
    given = {
        name: {"kind": "normal", "mean_rad_per_Nm": k, "std_rad_per_Nm": 2e-8}
        for name, k in mean.items()
    }
    study = springs_of({"joints": given})
    data, model, _ = day(study, 8, 0, {f"k_{name}": k for name, k in SOFT.items()})
    fit = fitted(study, data)
    assert fit.fitted.noise.model_fit is None
    setting = StudyGeometry.of(study)
    # Loads turn with the springs: the columns have that, too.
    load = resting_load(fit.fitted.bending, data.q, data.wrench, setting.loads)
    rows = model.see(fit.fitted.theta, data.q, load)
    A = rows.jacobian.reshape(len(data), -1, 2)
    off = (data.measured - rows.points).reshape(len(data), -1) + A @ fit.fitted.theta
    own = Prior(tuple(Gaussian(k, 2e-8) for k in mean.values()))
    springs = fit_with_prior(A, off, SIGMA / MM, ("k2", "k3"), own)
    np.testing.assert_allclose(fit.fitted.theta, springs.k, rtol=1e-9)
    covariance = fit.fitted.covariance * np.outer(model.scales, model.scales)
    np.testing.assert_allclose(covariance, springs.covariance, rtol=1e-9, atol=1e-25)


@pytest.mark.cell("`[joints] known_rad_per_Nm`", "parameters")
def test_a_known_compliance_is_a_parameter_with_a_prior() -> None:
    """A value with a standard deviation counts as an unknown one of which as much is known."""
    true = {f"k_{name}": k for name, k in SOFT.items()}
    known = {"unknown": ["q2"], "known_rad_per_Nm": {"q3": {"value": 4.9e-6, "std": 1e-7}}}
    normal = {"kind": "normal", "mean_rad_per_Nm": 4.9e-6, "std_rad_per_Nm": 1e-7}
    as_known = springs_of(joints=known)
    as_unknown = springs_of({"joints": {"q3": normal}})
    data, _, _ = day(as_unknown, 8, 1, true)
    one, other = fitted(as_known, data), fitted(as_unknown, data)
    np.testing.assert_allclose(one.fitted.theta, other.fitted.theta, rtol=1e-12)
    np.testing.assert_allclose(one.fitted.covariance, other.fitted.covariance, rtol=1e-12)


@pytest.mark.cell("`[joints] known_rad_per_Nm`", "parameters")
def test_a_compliance_that_is_known_exactly_bends_the_robot() -> None:
    """It is no parameter, and the residuals do not show its bend."""
    exact = {"unknown": ["q2"], "known_rad_per_Nm": {"q3": {"value": SOFT["q3"], "std": 0}}}
    study = springs_of(joints=exact)
    data, _, _ = day(springs_of(), 8, 2, {f"k_{name}": k for name, k in SOFT.items()})
    fit = fitted(study, data)
    assert [one.name for one in fit.fitted.model.parameters] == ["k_q2"]
    assert fit.fitted.compliances.tolist()[2] == SOFT["q3"]
    assert abs(fit.fitted.theta[0] - SOFT["q2"]) < 4 * fit.fitted.std[0] * 1e-6
    stiff = fitted(springs_of(joints={"unknown": ["q2"]}), data)
    assert fit.rms < 0.6 * stiff.rms


TWICE = {"q1": 6e-6, "q2": 5e-6}  # q1 is known as half of it


def half_known(kind: str, side: float) -> Study:
    """A study of q2 with a stiff wrist, whose loads tell q1 by their part from the side."""
    marker = {"position_mm": [100, 0, 50]}
    stiff = dict.fromkeys(("q3", "q4", "q5", "q6"), 1e-12)
    exact = {"load_percent": 0, "load_direction_deg": 0, "tool_mm": 0, "rigid_rad_per_Nm": stiff}
    alone = {"geometry": [], "base": False, "tool": False}
    visits = {"parameters": alone, "marker": [{"name": "A", **marker}]}
    return Study(
        robot=ROBOT,
        tool=marker,
        joints={"unknown": ["q2"], "known_rad_per_Nm": {"q1": 3e-6}},
        simulation={"compliance_rad_per_Nm": {"q2": TWICE["q2"]}},
        load={"F_N": [0, side, -300]},
        measurement={"sigma_mm": 0.005},
        noise={"model_error_percent": 0},
        uncertainty=exact,
        test_pose={
            "q_deg": [10, -40, 60, 20, 50, 10],
            "tool": marker,
            "load": {"F_N": [0, 200, -100]},
        },
        **(visits if kind == "parameters" else {}),
    )


def exact_sheet(study: Study, plan: Plan) -> pd.DataFrame:
    """What instruments read without errors of a robot whose q1 is twice as soft."""
    table = plan.to_frame(study.robot).drop(columns="repeats")
    if study.specification.parameters is None:
        model = replace(study.model, unknown=(0, 1))
        moved = model.regressor(plan.q, plan.wrench) @ list(TWICE.values())
        return table.assign(**dict(zip(("dx_mm", "dy_mm", "dz_mm"), MM * moved.T, strict=True)))
    setting = StudyGeometry.of(study)
    theta = np.array([TWICE[one.of] for one in setting.model.parameters])
    torque = setting.loads(plan.q, plan.wrench)
    x = setting.model.see(theta, plan.q, torque, derivatives=False).points[:, 0]
    return table.assign(**dict(zip(("Ax_mm", "Ay_mm", "Az_mm"), MM * x.T, strict=True)))


@pytest.mark.parametrize("side", [0.0, 10.0])
@pytest.mark.parametrize("kind", ["springs", "parameters"])
def test_what_rests_on_a_value_without_a_deviation_is_said_alike(kind: str, side: float) -> None:
    """Plan, sheet and commands say by how much a joint that is twice as soft breaks the promise."""
    study = half_known(kind, side)
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (12, 6))
    wrench = np.tile([0, side, -300.0, 0, 0, 0], (12, 1))
    if kind == "parameters":
        wrench[::2] = 0.0
    plan = Plan(q, wrench, np.ones(12, dtype=int))
    sheet = exact_sheet(study, plan)
    found = edtk.identify(study, sheet)
    commands = edtk.compensate(study, found)
    named = [
        [one.data for one in each if one.kind == "known_unstated"]
        for each in (edtk.evaluate(study, plan).warnings, found.findings, commands.findings)
    ]
    assert [len(one) for one in named] == [1, 1, 1]
    assert found.verdict == "usable"
    told = found.k if kind == "parameters" else {"q1": found.study.known[0], **found.k}
    error = [told[name] - TWICE[name] for name in ("q1", "q2")]
    broken = np.linalg.norm(study.tasks.with_unknown((0, 1)).target @ error)
    for (data,) in named:
        assert data["parameters"] == ("q1",)
        assert np.sqrt(data["softer"] ** 2 - data["total"] ** 2) == pytest.approx(broken, rel=2e-3)
    stated = {"unknown": ["q2"], "known_rad_per_Nm": {"q1": {"value": 3e-6, "std": 3e-6}}}
    kinds = [one.kind for one in edtk.identify(study.replace(joints=stated), sheet).findings]
    assert "known_unstated" not in kinds


@pytest.mark.cell("`[prior]`, which tells what the sheet does not", "parameters")
def test_a_prior_tells_what_the_sheet_leaves_open(tmp_path: Path) -> None:
    """A joint that stands still tells no zero of its own: a prior does, and this is said."""
    free, told = study_of(), study_of({"parameters": {"q6": {"std_mm": 0.2, "std_mrad": 0.3}}})
    data, model, true = day(free, 25, 5, {}, spread=0.3)
    q = data.q.copy()
    q[:, 4:] = 0.4
    x = model.see(true, q, derivatives=False).points
    x = x + np.random.default_rng(1).normal(0, SIGMA / MM, x.shape)
    sheet = by_pose(tmp_path / "day.csv", np.rad2deg(q), MM * x)
    without = edtk.identify(free, sheet)
    assert without.fit.open
    found = edtk.identify(told, sheet)
    said = {one.words for one in found.findings if one.kind == "rests_on_prior"}
    assert any("the measurements alone do not tell" in one for one in said)
    assert any("no poses alone tell" in one for one in said)
    assert found.fit.rank > without.fit.rank
    # What only the prior tells has its width.
    stds = [found.parameters[f"q6.{c}"]["std"] for c in ("x", "y", "z", "rx", "ry", "rz")]
    assert max(stds) == pytest.approx(0.3, rel=0.02)


def result_of(study: Study, data: MarkerPositions, path: Path) -> Path:
    """The result of a day, as a file."""
    sheet = by_pose(path.with_suffix(".csv"), np.rad2deg(data.q), MM * data.measured)
    path.write_text(json.dumps(edtk.identify(study, sheet).to_dict()))
    return path


@pytest.mark.cell("an earlier result as a prior", "parameters")
def test_an_earlier_result_is_a_prior_of_the_robot_alone(tmp_path: Path) -> None:
    """Two days, with other places of base and markers, tell what one fit of both would."""
    first = study_of()
    one, model, true = day(first, 25, 7, {}, spread=0.2)
    result = result_of(first, one, tmp_path / "first.json")
    again = {p.name: true[i] for i, p in enumerate(model.parameters) if p.place == "joint"}
    two, other, _ = day(first, 12, 8, again, spread=0.2)
    fit = fitted(study_of({"earlier_file": str(result)}), two)
    assert fit.fitted.noise.model_fit is None
    assert fit.told_before.square < 40
    assert fit.told_before.rank == sum(one.place == "joint" for one in fit.fitted.model.parameters)
    # One fit of both days: joints are shared, base and markers are of each day.
    own = np.array([p.place == "joint" for p in model.parameters])
    rows = []
    for data, theirs in ((one, model), (two, other)):
        J = theirs.see(np.zeros(model.p), data.q).jacobian * model.scales * MM
        rows.append(J.reshape(-1, model.p) / SIGMA)
    places = [np.where(own, 0.0, part) for part in rows]
    both = [np.hstack([rows[0], 0 * places[0]]), np.hstack([rows[1] * own, places[1]])]
    q = np.random.default_rng(3).uniform(-1.7, 1.7, (10, 6))
    J = (other.see(np.zeros(model.p), q).jacobian * model.scales * MM).reshape(-1, model.p)
    J = np.hstack([J * own, np.where(own, 0.0, J)])
    R = np.linalg.pinv(np.vstack(both), rcond=1e-9)
    known = np.linalg.norm(J @ R, axis=1)
    K = fit.fitted.columns(q, np.zeros((10, 6))).reshape(-1, fit.rank)
    std = np.sqrt(np.einsum("rp,pq,rq->r", K, fit.fitted.covariance, K))
    np.testing.assert_allclose(std, known, rtol=0.02)  # linear about the drawing, or not


@pytest.mark.parametrize(
    ("prior", "words"),
    [
        ({"parameters": {"q9": {"std_mm": 1}}}, "no parameter 'q9' is asked for"),
        ({"parameters": {"base": {"std_mm": 1}}}, "the sheet itself gives it"),
        ({"parameters": {"q2.rz": {"std_mm": 1}}}, "means no mm; expected std_mrad"),
        ({"parameters": {"q2": {}}}, "expected std_mm, std_mrad or both"),
        ({"parameters": {"q2": {"std_mm": 1, "mean_mrad": 1}}}, "mean_mrad goes with std_mrad"),
    ],
)
def test_a_prior_of_nothing_is_one_line(prior: dict, words: str) -> None:
    """What is said of no parameter of the study is refused, with the key."""
    with pytest.raises(UserError, match=words) as caught:
        study_of(prior)
    assert "prior.parameters" in str(caught.value)


def test_the_posterior_has_the_prior_too(tmp_path: Path) -> None:
    """Its normal approximation is the fit's; a compliance known to a factor is never negative."""
    density = {"kind": "log-normal", "median_rad_per_Nm": 3.1e-6, "factor": 1.02}
    study = springs_of({"joints": {"q2": density}})
    data, _, _ = day(study, 8, 4, {f"k_{name}": k for name, k in SOFT.items()})
    fit = fitted(study, data)
    setting = StudyGeometry.of(study)
    posterior = GeometryDensity.of(fit, setting.loads, robust=False)
    np.testing.assert_allclose(posterior.mode, fit.fitted.values, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(posterior.root, axis=1), fit.fitted.std, rtol=1e-6)
    draws = np.random.default_rng(0).standard_normal((2000, 2))
    log_weight = posterior.log_density(draws) + 0.5 * (draws**2).sum(axis=1)
    weight = np.exp(log_weight - log_weight.max())
    assert weight.sum() ** 2 / (weight**2).sum() > 0.99 * len(draws)


POSE = {"q_deg": [10, -60], "tool": {"position_mm": [500, 0, 0]}, "load": {"F_N": [0, 0, -50]}}
DESIGNED = {"geometry": {"std_mm": 0.3, "std_mrad": 0.3}}
PLANAR = {
    "robot": PLANAR_ROBOT,
    "tool": {"position_mm": [500, 0, 0]},
    "load": {"F_N": [0, 0, -100]},
    "marker": [
        {"name": "A", "position_mm": [0, 30, 10]},
        {"name": "B", "position_mm": [-60, 0, 50]},
    ],
    "measurement": {"sigma_mm": 0.1},
    "parameters": {"geometry": ["zeros"], "compliance": ["q1"], "base": True, "tool": False},
    "joints": {"unknown": ["q1"], "known_rad_per_Nm": {"q2": {"value": 2e-6, "std": 5e-7}}},
    "test_pose": POSE,
    "candidates": 30,
}


def planar(**prior: object) -> Study:
    """An arm of two joints, of whose geometry something is known."""
    return Study(**PLANAR, prior={"parameters": DESIGNED, **prior})


def test_information_of_the_prior_counts_beside_that_of_a_plan() -> None:
    """Of all parameters with a prior each counts as one more row of its own."""
    study, plain = planar(in_design=True), planar()
    question = GeometryQuestion.of(study)
    names = question.space.parameters
    std = [0.3 if name[0] == "q" else 0.5 if name == "k_q2" else np.inf for name in names]
    np.testing.assert_allclose(question.prior, np.diag(np.array(std) ** -2.0), atol=1e-9)
    # Without it known compliances alone count, and fewer parameters can be told apart.
    assert GeometryQuestion.of(plain).model.p < question.model.p
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, (6, 2))
    wrench = np.zeros((6, 6))
    wrench[::2, 2] = -100.0
    plan = edtk.Plan(q, wrench, np.ones(6, dtype=int))
    found = edtk.evaluate(study, plan)
    rows = PositionRows(question.model, question.setting.loads, question.space.noise)(q, wrench)
    A = rows.reshape(-1, question.model.p)
    covariance = np.linalg.inv(A.T @ A + np.diag(np.array(std) ** -2.0))
    np.testing.assert_allclose(found.std, np.sqrt(np.diag(covariance)), rtol=1e-6)
    assert found.criteria["A"] == pytest.approx(np.trace(covariance), rel=1e-6)
    rho0 = np.sqrt(np.einsum("rp,pq,rq->", question.target, covariance, question.target))
    assert found.rho0 == pytest.approx(rho0, rel=1e-6)
    assert found.to_dict()["with_prior"]


@pytest.mark.parametrize("criterion", ["A", "rho0"])
def test_certificates_with_a_prior_are_verified(criterion: str, tmp_path: Path) -> None:
    """The second implementation finds value and bound, of weights and of plans."""
    study = planar(in_design=True)
    edtk.relax(study, criterion, size=6, certificate=tmp_path / "relaxed.json")
    edtk.plan(study, 6, criterion, certificate=tmp_path / "plan.json")
    for name in ("relaxed", "plan"):
        content = json.loads((tmp_path / f"{name}.json").read_text())
        assert edtk.verify(content, study, size=6).valid
        content["setting"]["prior"][0][-1] += 1.0
        assert not edtk.verify(content).valid


@pytest.mark.cell("`[prior] in_design`, and `relax --size`", "parameters")
def test_a_prior_counts_the_less_the_more_visits_share_it() -> None:
    """Weights are those of plans of a size, which needs a prior in the design."""
    study = planar(in_design=True)
    few, many = (edtk.relax(study, "D", size=size).value for size in (4, 400))
    assert few > many
    bare = Study(**PLANAR | {"joints": {"unknown": ["q1"]}})
    with pytest.raises(UserError, match="no effect without a prior"):
        edtk.relax(bare, "D", size=4)


def test_a_plan_with_a_prior_within_a_budget_is_verified(tmp_path: Path) -> None:
    """Each set of loads has its share of what is known."""
    study = planar(in_design=True).replace(costs={"visit": 1, "load_change": 2, "budget": 9})
    found = edtk.plan(study, criterion="A", certificate=tmp_path / "c.json")
    assert found.bound <= found.cost
    assert edtk.verify(tmp_path / "c.json", study).valid


def test_what_was_known_is_compared_with_all_else() -> None:
    """The estimate beside a density is that of the fit without it, and its distance is normal."""
    wrong = {"kind": "normal", "mean_rad_per_Nm": 8e-6, "std_rad_per_Nm": 1e-6}
    study = springs_of({"joints": {"q2": wrong}})
    data, _, _ = day(study, 8, 0, {f"k_{name}": k for name, k in SOFT.items()})
    fit, alone = fitted(study, data), fitted(springs_of(), data).fitted
    told = fit.told_before
    assert np.isinf(told.dof)
    assert told.mean[0] == pytest.approx(alone.theta[0], rel=1e-5)
    assert told.std[0] == pytest.approx(1e-6 * alone.std[0], rel=1e-3)
    said = {one.kind: one.data for one in geometric_findings(fit, StudyGeometry.of(study))}
    distance = (8e-6 - told.mean[0]) / np.hypot(1e-6, told.std[0])
    assert said["prior_contradicted"]["p"] == pytest.approx(2 * norm.sf(distance), rel=1e-3)
    right = springs_of({"joints": {"q2": wrong | {"mean_rad_per_Nm": 3.5e-6}}})
    kinds = {one.kind for one in geometric_findings(fitted(right, data), StudyGeometry.of(right))}
    assert "prior_contradicted" not in kinds


@pytest.mark.cell("`[prior]` that the sheet contradicts is a finding", "parameters")
def test_a_known_compliance_that_loads_contradict_is_named() -> None:
    """What is known is measured, too."""
    joints = {"unknown": ["q2"], "known_rad_per_Nm": {"q3": {"value": 1e-5, "std": 1e-6}}}
    study = springs_of(joints=joints)
    data, _, _ = day(study, 8, 0, {f"k_{name}": k for name, k in SOFT.items()})
    found = geometric_findings(fitted(study, data), StudyGeometry.of(study))
    (said,) = [one.words for one in found if one.kind == "known_contradicted"]
    assert said.startswith("q3 is known as 1e-05 +- 1e-06 rad/(N m) and measured as 5")


def test_a_run_of_a_study_with_a_prior_is_done(tmp_path: Path) -> None:
    """Relaxations are those of each size, as a prior counts the less, the more visits there are."""
    study = planar(in_design=True).replace(
        sizes=[5, 6], optimise=["A"], criteria=["A"], starts=1, costs={"visit": 1, "budget": 6}
    )
    found = edtk.run(study, tmp_path / "out", workers=1)
    assert {"A_m5", "A_m6"} <= set(found.relaxations)
    table = found.table
    assert (table["efficiency_A"] <= 1 + 1e-9).all()

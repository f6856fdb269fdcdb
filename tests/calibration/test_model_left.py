"""Errors of the model: repeats do not average them out, tasks have them, and bands hold them."""

import itertools
import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from kr270 import REQUIRED, TEST_POSE

import edtk
from edtk.calibration.model_left import ModelLeft, possible_from_dict, possible_to_dict
from edtk.design.candidate_source import sample_feasible
from edtk.findings.fitted_data import FittedData
from edtk.fit import correlated_noise
from edtk.fit.distributions import NormalMixture, error_quantiles, weighted_median
from edtk.fit.identify import identify
from edtk.fit.measurements import Measurements
from edtk.fit.missing import SIZES, MissingColumns, SizeLikelihood, prior_of_sizes
from edtk.measure.friction import SPREAD_OF_SHARES, scatter
from edtk.measure.missing_pieces import SPREAD_ACROSS, MissingPieces, PieceColumns, PossibleSprings

SURE = {"load_percent": 0, "load_direction_deg": 0, "tool_mm": 0, "rigid_rad_per_Nm": {"q1": 1e-15}}
STUDY = edtk.Study(**REQUIRED, test_pose=TEST_POSE, uncertainty=SURE)
K = np.array([3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
EXACT = STUDY.replace(noise={"model_error_percent": 0})
# How large the pieces of a simulated robot are: springs across, friction, turns.
ACROSS, HELD, TURN = np.eye(3)
RNG = np.random.default_rng


def day(number, sizes, poses=12, repeats=1):
    """Readings of a robot with pieces of some sizes, and what it does in the test pose."""
    rng = RNG((number, 5))
    q = sample_feasible(STUDY.space, poses, number)[:, :6]
    wrench = np.tile(STUDY.space.load.always, (poses, 1))
    model = STUDY.model
    every = np.append(0.0, K)
    pieces = MissingPieces.of(STUDY.robot, every, model.torque_of(model.frames(q), wrench).T)
    kinds = pieces.columns(model, q, wrench).kinds
    # Neither friction nor a compliance is negative: exponential, half-normal, of mean square one.
    across = np.abs(rng.standard_normal(len(kinds)))
    held = RNG((number, 6)).exponential(size=len(kinds)) / np.sqrt(2)
    u = np.where(kinds == 1, held / scatter(SPREAD_OF_SHARES), across) * np.asarray(sizes)[kinds]
    task = replace(STUDY.task.model, unknown=model.unknown)

    def moves(of, q, wrench):
        columns = pieces.columns(of, q, wrench)
        turns = (columns.turns @ (sizes[2] * rng.standard_normal((len(q), 6, 1))))[..., 0]
        return of.regressor(q, wrench) @ K + columns.shared(sizes[1]) @ u + turns

    there = moves(task, STUDY.task.q[None], STUDY.task.wrench[None])[0]
    shown = np.repeat(moves(model, q, wrench), repeats, axis=0)
    shown = shown + STUDY.sigma * rng.standard_normal(shown.shape)
    q, wrench = np.repeat(q, repeats, axis=0), np.repeat(wrench, repeats, axis=0)
    sigma = np.tile(STUDY.sigma, (len(q), 1))
    return Measurements(q, wrench, shown, sigma, np.zeros((len(q), 3))), there


def sheet(data):
    """The table that a person fills in."""
    table = pd.DataFrame(np.rad2deg(data.q), columns=[f"q{i}_deg" for i in range(1, 7)])
    table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * data.deflection
    return table


def found_of(data, study=STUDY):
    """The calibration of a day."""
    return edtk.identify(study, sheet(data))


@pytest.fixture(scope="module")
def bent():
    """A day of a robot with springs across, and its calibration."""
    data, _ = day(5, 0.15 * ACROSS)
    return data, found_of(data)


def test_an_exact_model_has_the_numbers_of_noise():
    """Where the study says that nothing is missing, nothing is counted beside the noise."""
    found = found_of(day(1, 0.1 * ACROSS)[0], EXACT)
    assert found.fitted.model_error is None
    assert found.budget.model == 0
    assert found.to_dict()["model_error_mm"] == 0
    assert "possible_springs" not in found.to_dict()
    commands = edtk.compensate(EXACT, found)
    A0 = EXACT.task.regressor
    expected = error_quantiles(A0, found.fit.covariance, (0.025, 0.975), found.fit.covariance_dof)
    np.testing.assert_allclose(commands.band[0], expected, rtol=1e-6)


def test_ideal_springs_are_promised_what_they_do():
    """Where a sheet shows nothing, estimate and noise stay, and little is promised beside."""
    data, _ = day(2, 0 * ACROSS, poses=20)
    found, exact = found_of(data), found_of(data, EXACT)
    np.testing.assert_array_equal(found.fit.k, exact.fit.k)
    np.testing.assert_array_equal(found.fit.covariance, exact.fit.covariance)
    assert not found.fitted.model_error.counts
    assert exact.budget.total <= found.budget.total < 2 * exact.budget.total


@pytest.mark.parametrize(("piece", "name"), [(ACROSS, "across"), (HELD, "held"), (TURN, "turn")])
def test_what_is_missing_is_named(piece, name):
    """A large piece is found, with about its size, counts in the budget, and is said."""
    found = found_of(day(3, 0.15 * piece, poses=30)[0])
    sizes = found.to_dict()["model_error"]
    assert 5 < sizes[f"{name}_percent"] < 40
    assert max(sizes, key=sizes.__getitem__) == f"{name}_percent"
    assert found.budget.model > found.budget.noise
    assert found.to_dict()["model_error_mm"] == 1e3 * found.budget.model
    (said,) = [one for one in found.findings if one.kind == "model_error"]
    assert "which its model lacks: the expected error counts" in said.words


def left_by(found, sizes):
    """Error in the task by springs and pieces, if these have some sizes of the scale [m]."""
    seen = found.fitted.model_error.posterior
    at = (seen.sizes == sizes).all(axis=1)
    mean, _ = seen.solved(np.flatnonzero(at)[:1])
    by_size = np.reshape(1.0 * at, seen.by_size.shape)
    sure = replace(seen, by_size=by_size).possible(mean[0, -len(K) :])
    left = ModelLeft.of(found.fitted, np.zeros((len(K), 0)))
    return replace(left, possible=sure).size(STUDY.tasks)


def test_repeats_do_not_average_errors_of_the_model():
    """Sixteen visits of each pose leave what the model does to the springs; more poses do not.

    Of turns of a size s, variances are those of ``sigma^2 / r + s^2 v``: r repeats quarter the
    error where s is zero, and leave it where turns are much larger than the noise. What a sheet
    promises falls a little, as repeats show better which piece it is, but not below what turns do
    in the task itself.
    """
    few, repeated, more = (
        found_of(day(4, 0.1 * TURN, poses, repeats)[0])
        for poses, repeats in ((6, 1), (6, 16), (48, 1))
    )
    assert repeated.budget.noise < 0.3 * few.budget.noise
    size = SIZES[np.abs(SIZES - 0.1).argmin()] * TURN
    assert left_by(repeated, 0 * TURN) < 0.3 * left_by(few, 0 * TURN)
    assert left_by(repeated, size) > 0.9 * left_by(few, size)
    task = replace(STUDY.task.model, unknown=None)
    columns = task.regressor(STUDY.task.q, STUDY.task.wrench) * np.append(0.0, K)
    for found in (few, repeated, more):
        assert found.budget.model > np.linalg.norm(size[2] * columns)
    assert np.median(repeated.fit.std / few.fit.std) > 0.5
    assert np.median(more.fit.std / few.fit.std) < 0.5


def test_bands_hold_errors_of_the_model():
    """Of simulated robots that lack pieces nine in ten and more are inside, and few without."""
    inside, without, ratio = [], [], []
    for number in range(24):
        sizes = 0.1 * np.eye(3)[number % 3]
        data, there = day(number, sizes)
        A = data.regressor(STUDY.model)
        fit = identify(A, data.deflection, data.sigma, STUDY.model.parameters)
        torque = STUDY.model.torque_of(STUDY.model.frames(data.q), data.wrench)
        pieces = MissingPieces.of(STUDY.robot, np.append(0.0, fit.k), torque.T)
        none = np.zeros((*data.deflection.shape, 0))
        columns = pieces.columns(STUDY.model, data.q, data.wrench)
        shown = MissingColumns(columns, data.pose, none)
        seen = SizeLikelihood.of(A, data.deflection, data.sigma, shown)
        possible = seen.posterior.possible(fit.unbounded)
        error = np.linalg.norm(there - STUDY.task.regressor @ fit.unbounded)
        left = ModelLeft((1, 2, 3, 4, 5), pieces, possible, fit.covariance, np.zeros((5, 5)))
        own = left.mixture(STUDY.task.model, STUDY.task.q[None], STUDY.task.wrench)
        low, high = own.quantiles([0.025, 0.975])[0]
        inside.append(low <= error <= high)
        alone = error_quantiles(STUDY.task.regressor, fit.covariance, [0.025, 0.975])
        without.append(alone[0] <= error <= alone[1])
        ratio.append(error / own.size[0])
    assert np.mean(inside) >= 0.87
    assert np.mean(without) < 0.5
    assert 0.5 < np.median(ratio) < 2


def test_compensate_and_predict_count_it_from_the_file(tmp_path, bent):
    """The band of `compensate`, and its total, are those of the budget; a file says the same."""
    data, found = bent
    file = tmp_path / "k.json"
    file.write_text(json.dumps(found.to_dict()))
    direct, read = edtk.compensate(STUDY, found), edtk.compensate(STUDY, file)
    assert direct.remaining[0] == pytest.approx(found.budget.total, rel=1e-9)
    np.testing.assert_allclose(read.band, direct.band, rtol=1e-9)
    poses = sheet(day(6, 0 * ACROSS)[0])[[f"q{i}_deg" for i in range(1, 7)]]
    wide = edtk.predict(STUDY, found, poses).half
    narrow = edtk.predict(EXACT, found_of(data, EXACT), poses).half
    assert (wide > narrow).all()
    np.testing.assert_allclose(edtk.predict(STUDY, file, poses).half, wide, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights": [0.0]}, "weights: expected a number that is not zero"),
        ({"turn": [-1.0]}, "turn: expected"),
        ({"links": [[0]]}, "links: expected a list of joints from 1 to 5"),
        ({"noise": "x"}, "noise: expected"),
    ],
)
def test_bad_files_are_one_line(change, message, tmp_path, bent):
    """What cannot be read of a file is refused by its name."""
    result = bent[1].to_dict()
    result["possible_springs"] |= change
    with pytest.raises(edtk.UserError, match=message):
        edtk.compensate(STUDY, result)
    path = tmp_path / "k.json"
    path.write_text(json.dumps(result), encoding="utf-8")
    with pytest.raises(edtk.UserError, match=rf"k\.json: possible_springs: {message}"):
        edtk.compensate(STUDY, path)


def test_what_is_no_covariance_is_refused(bent):
    """Variances below zero are a line, not bands that are no numbers."""
    result = bent[1].to_dict()
    table = result["possible_springs"]
    negative = [[-entry for entry in row] for row in table["covariance"]]
    result["possible_springs"] = table | {"covariance": negative}
    with pytest.raises(edtk.UserError, match="covariance: expected covariances, without negative"):
        edtk.compensate(STUDY, result)


def test_files_of_before_have_springs_at_the_joints_alone():
    """One that names no links says the same of its shares, fewer than today's."""
    k = np.append(0.0, K)
    (_, held, turn), order = np.eye(3), 3 * len(k) + 2
    possible = PossibleSprings(
        np.full(3, 1 / 3), held, turn, np.ones((3, order)), np.tile(np.eye(order), (3, 1, 1))
    )
    given = possible_to_dict(MissingPieces(k, k), possible)
    assert given.pop("links") == []
    pieces, read = possible_from_dict(given, 2, len(k))
    assert pieces.links == ()
    np.testing.assert_array_equal(read.covariance, possible.covariance)


def test_untold_pieces_are_said_and_not_good():
    """Four poses of largest loads, many times, cannot tell friction: that is assumed, and said."""
    data, _ = day(8, 0 * ACROSS, poses=3, repeats=4)
    found = found_of(data)
    if "model_untold" in (kinds := [one.kind for one in found.findings]):
        (said,) = [one for one in found.findings if one.kind == "model_untold"]
        assert "do not tell friction and springs that the model lacks" in said.words
        assert found.verdict != "good"
    low, high = edtk.compensate(STUDY, found).band[0]
    assert high > 3 * found.budget.total, kinds
    assert low < found.budget.total


def test_restricted_likelihood_of_sizes():
    """Probabilities of sizes are those of dense matrices, and so are the springs for each."""
    rng = RNG(9)
    m, p, n = 5, 2, 4
    A, U, T = (rng.normal(size=(m, 3, w)) for w in (p, 3, n))
    E, y = rng.normal(size=(m, 3, 2)), rng.normal(size=(m, 3))
    pose = np.array([0, 0, 1, 2, 3])
    pieces = PieceColumns(U, T, 0.1 * rng.normal(size=(m, n)), np.full(n, 1.0))
    kinds, mean = pieces.kinds, pieces.mean
    assert kinds.tolist() == [0] * 3 + [1] * n
    sigma = np.full((m, 3), 0.3)
    found = SizeLikelihood.of(A, y, sigma, MissingColumns(pieces, pose, E)).posterior
    logs, means = [], []
    flat = [x.reshape(3 * m, -1) for x in (A, T, E)]
    same = np.kron(pose[:, None] == pose, np.ones((3, 3)))
    tiny = np.finfo(float).tiny  # of springs across that are there, and of no size
    prior = [dict(zip(SIZES, np.log(one + tiny), strict=True)) for one in prior_of_sizes()]
    # Each of the three columns is across another joint: any of them may be there, of one size.
    there = np.array(list(itertools.product([False, True], repeat=3)))
    np.testing.assert_array_equal(found.places.masks, there)
    number = there.sum(axis=1)
    chances = 0.25 / np.array([1, 3, 3, 1])[number]
    for which, sizes in enumerate(found.sizes):
        across, held, turn = sizes
        place = which % len(there)
        S = np.append(scatter(SPREAD_ACROSS) * across * there[place], np.full(n, held))
        np.testing.assert_array_equal(found.scales(np.array([which]))[0], S)
        R = 0.09 * np.eye(3 * m) + turn**2 * same * (flat[1] @ flat[1].T) + flat[2] @ flat[2].T
        shared = pieces.shared(held).reshape(3 * m, -1)
        V = R + (shared * S**2) @ shared.T
        P = np.linalg.inv(V)
        M = flat[0].T @ P @ flat[0]
        rest = y.ravel() - shared @ (S * mean)
        k = np.linalg.solve(M, flat[0].T @ P @ rest)
        r = rest - flat[0] @ k
        log = -0.5 * (np.linalg.slogdet(V)[1] + np.linalg.slogdet(M)[1] + r @ P @ r)
        of_size = 0.0 if not number[place] and not across else prior[0][across]
        impossible = (across > 0) != (number[place] > 0)
        known = of_size + prior[1][held] + prior[2][turn] + np.log(chances[place])
        logs.append(-np.inf if impossible else log + known)
        means.append(np.append(S * mean + S**2 * (shared.T @ P @ r), k))
    weights = np.exp(np.array(logs) - max(logs))
    np.testing.assert_allclose(found.weights, weights / weights.sum(), rtol=1e-8, atol=1e-14)
    some = np.flatnonzero(weights > 0)
    means = np.array(means)[some]
    np.testing.assert_allclose(found.solved(some)[0], means, rtol=1e-8, atol=1e-10)
    scales = np.array([found.scales(np.array([one]))[0] for one in some])
    np.testing.assert_allclose(found.spread[0] ** 2, found.weights[some] @ scales**2)
    np.testing.assert_allclose(found.spread[1] ** 2, found.weights @ found.sizes[:, 2] ** 2)


def test_prior_of_sizes():
    """Friction is absent in a quarter, turns in a half; means are as asked where one is there."""
    for prior, absent in zip(prior_of_sizes(0.1), (0.0, 0.25, 0.5), strict=True):
        assert prior.sum() == pytest.approx(1)
        assert prior[0] == absent
        assert prior @ SIZES / (1 - absent) == pytest.approx(0.1, rel=0.15)


def test_mixtures_of_normal_errors():
    """Quantiles of one part are those of its normal errors; medians are by weight."""
    rng = RNG(3)
    V = np.diag([1.0, 4.0, 0.2])
    one = NormalMixture(np.ones(1), np.zeros((1, 1, 3)), V[None, None])
    expected = error_quantiles(np.eye(3), V, [0.1, 0.5, 0.9])
    np.testing.assert_allclose(one.quantiles([0.1, 0.5, 0.9])[0], expected, rtol=0.03)
    assert one.size[0] == pytest.approx(np.sqrt(5.2))
    both = NormalMixture(np.array([0.9, 0.1]), np.zeros((2, 1, 3)), np.array([V, 100 * V])[:, None])
    draws = np.sqrt(np.where(rng.random(20_000) < 0.1, 100, 1)) * np.linalg.norm(
        rng.standard_normal((20_000, 3)) * np.sqrt(np.diag(V)), axis=1
    )
    assert both.beyond(np.array([5.0]))[0] == pytest.approx((draws > 5).mean(), abs=0.01)
    assert both.size[0] == pytest.approx(np.sqrt(5.2))
    values = np.array([[3.0], [1.0], [2.0]])
    assert weighted_median(values, np.array([0.2, 0.2, 0.6]))[0] == 2.0


VISITS = STUDY.replace(
    joints={"fixed_deg": {"q1": 0}},
    parameters={"compliance": ["q2", "q3", "q4", "q5", "q6"], "geometry": [], "base": False}
    | {"tool": False},
    marker=[{"name": "A"}],
    measurement={"sigma_mm": 0.02, "reference": "unloaded"},
    uncertainty={"load_direction_deg": 0},
)


@pytest.mark.parametrize("size", [0.0, 0.15], ids=["ideal", "across"])
def test_visits_under_loads_tell_pieces_too(size):
    """A study with [parameters] that reads differences has the same keys, bands and findings."""
    data, _ = day(7, size * ACROSS, poses=16)
    found = edtk.identify(VISITS, sheet(data).assign(marker="A"))
    result = found.to_dict()
    commands = edtk.compensate(VISITS, found)
    low, high = commands.band[0]
    assert low < commands.remaining[0] < high
    assert ("model_error" in [one.kind for one in found.findings]) == (size > 0)
    assert (result["model_error"]["across_percent"] > 5) == (size > 0)
    alone = found_of(data).budget
    assert 1e-3 * result["model_error_mm"] == pytest.approx(alone.model, rel=0.5, abs=1e-5)


def test_a_robot_that_bends_is_usable_and_a_wrong_sheet_is_not():
    """Springs across that are said and counted make no alarm; a column of the wrong sign does.

    Those of one size across all joints, or across one joint, explain most of the misfit and leave
    what noise does not make: they are said as a part of it, and the cause is the model.
    """
    data, _ = day(4, 0 * ACROSS, poses=20)
    model = STUDY.model
    torque = model.torque_of(model.frames(data.q), data.wrench).T
    pieces = MissingPieces.of(STUDY.robot, np.append(0.0, K), torque)
    more = 0.2 * pieces.columns(model, data.q, data.wrench).across.sum(axis=-1)
    table = sheet(replace(data, deflection=data.deflection + more))
    bends = edtk.identify(STUDY, table)
    assert bends.causes == ()
    assert "to bend across its axis too" in bends.findings[0].words
    assert bends.fit.p_value < 1e-6
    assert bends.verdict == "usable"
    assert edtk.identify(EXACT, table).verdict == "bad"
    wrong = table.assign(dx_mm=-table["dx_mm"])
    assert edtk.identify(STUDY, wrong).verdict == "bad"


def test_visits_of_a_robot_that_is_said_to_be_exact_tell_no_pieces():
    """What the study says of its model holds in studies with [parameters], too."""
    table = sheet(day(7, 0.15 * ACROSS, poses=16)[0]).assign(marker="A")
    exact = edtk.identify(VISITS.replace(noise={"model_error_percent": 0}), table)
    assert exact.pieces is None
    assert "model_error" not in [one.kind for one in exact.findings]


@pytest.mark.parametrize(
    ("piece", "poses", "repeats"), [(ACROSS, 14, 1), (HELD, 14, 2), (TURN, 14, 1)]
)
def test_poses_left_out_are_inside_bands_that_count_the_model(piece, poses, repeats):
    """Bands of the noise alone miss poses that are predicted without themselves; these do not."""
    found = found_of(day(7, 0.15 * piece, poses, repeats)[0])
    out = found.fitted.left_out
    assert out.share_inside < 0.8
    assert out.share_with_model > 0.9
    assert found.to_dict()["share_inside_left_out"] == out.share_with_model


def test_the_part_of_the_model_in_poses_left_out():
    """It is that of fits which were made anew without each pose, column by column."""
    fitted = found_of(day(7, 0.15 * ACROSS)[0]).fitted
    A, rows = fitted.A, np.arange(len(fitted.data))
    shared, turns = fitted.model_error.columns(rows)
    expected = np.zeros(A.shape[:2])
    for b in rows:
        others = rows[rows != b]
        X = A[others].reshape(-1, 5)
        every = np.zeros((len(rows), 3, len(rows), 6))
        every[rows, :, rows] = turns
        for U in (shared, every.reshape(len(rows), 3, -1)):
            k = np.linalg.lstsq(X, U[others].reshape(len(X), -1), rcond=None)[0]
            expected[b] += np.square(U[b] - A[b] @ k).sum(axis=-1)
    np.testing.assert_allclose(fitted.left_out.model, expected, rtol=1e-6)


def test_rows_at_once_do_not_matter(monkeypatch):
    """A sheet whose columns are kept for some poses at a time says the same."""
    sheet = day(6, 0.15 * HELD, 14, 2)[0]
    whole = found_of(sheet)
    monkeypatch.setattr(correlated_noise, "ROWS_AT_ONCE", 5)
    some = found_of(sheet)
    assert some.to_dict()["model_error"] == pytest.approx(whole.to_dict()["model_error"], rel=1e-9)
    np.testing.assert_allclose(some.fitted.left_out.model, whole.fitted.left_out.model, rtol=1e-9)
    one, other = (fitted.model_error.posterior for fitted in (some.fitted, whole.fitted))
    np.testing.assert_allclose(one.weights, other.weights, rtol=1e-6, atol=1e-12)


def varying_day(number, off, m=30):
    """Readings of springs that vary by 15 % with the angle; two rows are off by so many sigma."""
    rng = RNG((number, 7))
    q = sample_feasible(STUDY.space, m, number)[:, :6]
    wrench = np.tile(STUDY.space.load.always, (m, 1))
    soft = K / (1 + 0.15 * np.sin(q + rng.uniform(0, 2 * np.pi, 6)))[:, 1:]
    shown = np.einsum("mrp,mp->mr", STUDY.model.regressor(q, wrench), soft)
    shown = shown + STUDY.sigma * rng.standard_normal(shown.shape)
    rows = np.sort(rng.choice(m, 2, replace=False))
    away = rng.standard_normal((2, 3))
    shown[rows] += off * STUDY.sigma * away / np.linalg.norm(away, axis=1)[:, None]
    data = Measurements(q, wrench, shown, np.tile(STUDY.sigma, (m, 1)), np.zeros((m, 3)))
    return data, tuple(rows.tolist())


@pytest.mark.slow
def test_columns_of_all_poses_are_not_in_memory_together(monkeypatch):
    """Readings left out take some kilobytes a row where blocks are small beside the sheet."""
    monkeypatch.setattr(correlated_noise, "ROWS_AT_ONCE", 4)
    fitted = FittedData.of(STUDY, varying_day(0, 0, 40)[0])
    tracemalloc.start()
    assert fitted.left_out is not None
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4000 * 40


def test_rows_beyond_the_errors_of_the_model_are_named_first():
    """Where no cause explains a misfit, rows that stand out beyond what the others show do."""
    data, rows = varying_day(0, 15)
    first, second = found_of(data).findings[:2]
    assert (first.kind, first.rows, second.kind) == ("outliers", rows, "no_cause")
    assert "beyond what the model leaves out of the other rows" in first.words
    sound = found_of(varying_day(0, 0)[0])
    assert "outliers" not in [one.kind for one in sound.findings]

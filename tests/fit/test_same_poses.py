"""Visits of a pose share what the drawing errs by: two readings say what their difference does."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from test_fit_geometry import OFFSETS, SIX, AtTool, white

from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.fitted_geometry import GeometricFit
from edtk.fit.geometry_posterior import GeometryDensity
from edtk.fit.judge_geometry import left_out_alone
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.place_robot import place_robot
from edtk.fit.same_poses import SAME_ANGLES, SamePoses
from edtk.measure.equilibrium import loading_in
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import all_parameters

Array = NDArray[np.float64]
K = np.array([2e-6, 3e-6, 5e-6, 2e-5, 2e-5, 4e-5])
SIGMA = 0.005  # [mm]
MARKERS = ("A", "B", "C")


def test_rows_are_independent_and_lead_back() -> None:
    """Covariances of visits become those of a mean and of differences, and back."""
    n = np.array([[1, 2], [3, 1], [2, 0], [4, 2]])[:, :, None]
    q = SAME_ANGLES * np.array([[500], [4000], [500.2], [499.8]])
    same = SamePoses.of(q, n.astype(float), np.zeros(4, dtype=bool), np.zeros(4, dtype=bool))
    assert same.pose.tolist() == [0, 1, 0, 0]
    assert same.differs.tolist() == [False, False, True, True]
    assert same.worth[0, :, 0] == pytest.approx([7, 4])
    assert same.worth[1, :, 0] == pytest.approx([3, 1])
    assert same.worth[2, :, 0] == pytest.approx([2 / 3, 0])
    R, D = 0.3, 5.0
    told = np.where(n > 0, 1 / np.maximum(n, 1), 0.0)[:, :, 0]
    for marker in range(2):
        V = np.zeros((4, 4))
        V[np.ix_([0, 2, 3], [0, 2, 3])] = D
        V[1, 1] = D
        read = n[:, marker, 0] > 0
        V = (V + np.diag(R * told[:, marker])) * np.outer(read, read)
        root = np.linalg.cholesky(V + 1e-12 * np.eye(4))
        each = np.zeros((4, 2, 1, 4))
        each[:, marker, 0] = root
        rows = same.apart(each)[:, marker, 0]
        worth = same.worth[:, marker, 0]
        expected = np.where(worth > 0, R / np.where(worth > 0, worth, 1) + D * ~same.differs, 0)
        assert rows @ rows.T == pytest.approx(np.diag(expected), abs=1e-9)
        back = same.back(same.apart(each))[:, marker, 0]
        assert back[read] == pytest.approx(root[read], abs=1e-9)
        variances = np.zeros((4, 2, 1))
        variances[:, marker, 0] = expected
        assert same.variances(variances)[:, marker, 0] == pytest.approx(np.diag(V), abs=1e-9)
    (once, _), (thrice, together) = same.together(np.tile(np.eye(2), (4, 1, 1)))
    assert (once.tolist(), thrice.tolist()) == ([[1]], [[0, 2, 3]])
    assert together == pytest.approx(np.swapaxes(together, 1, 2))


def test_rows_have_their_shares_of_what_a_load_changes() -> None:
    """Changes of visits under a load are independent, and their rows lead back to the visits."""
    loaded = np.array([False, True, True, False, True])
    differs = np.arange(5) == 4
    q = SAME_ANGLES * np.array([[500.0], [500], [500], [9000], [500]])
    same = SamePoses.of(q, np.ones((5, 1, 2)), differs, loaded)
    each = np.zeros((5, 1, 2, 5))
    each[np.arange(5), :, :, np.arange(5)] = same.changed[:, None, None]
    rows = same.apart(each)[:, 0, 0]
    assert same.changes[:, 0, 0] == pytest.approx((rows**2).sum(axis=1))
    assert same.changes[[3, 4], 0, 0].tolist() == [0, 1]
    _, several = same.every
    roots = several.roots(np.where(several.members, 1.0, 0.0)[..., None] * [1.0, 2.0])
    U = roots[0, ..., 1]
    V = np.einsum("ai,bi->ab", U, U)
    every = np.zeros((1, 3, 2, 3, 2))
    every[0, :, 1, :, 1] = V
    found = several.of_visits(every.reshape(1, 6, 6)).reshape(3, 2, 3, 2)
    assert found[:, 1, :, 1] == pytest.approx(np.diag([0.0, 4, 4]), abs=1e-12)


def test_means_know_how_many_readings_they_are_of() -> None:
    """Through a choice of markers, further visits and instruments, and means of means."""
    _, data = day(drawing_mm=0.5)
    thrice = replace(data, readings=np.full(data.seen.shape, 3)).of_markers([2, 0])
    assert thrice.often.shape == thrice.seen.shape
    both = thrice.with_visits(data.of_markers([2, 0]))
    assert both.counts == pytest.approx(np.full((len(data), 2), 4))
    first, again = thrice.measured, data.measured[:, [2, 0]] + 4e-3
    mean = thrice.with_visits(replace(data.of_markers([2, 0]), measured=again)).means
    assert mean.measured == pytest.approx(first + 1e-3)
    assert mean.means.counts.tolist() == mean.readings.tolist()
    other = replace(data.of_markers([1]), kinds=("position",))
    more = thrice.with_markers(other).means
    assert more.counts.tolist() == [[3, 3, 1]] * len(data)
    hidden = replace(thrice, measured=np.where([[[True], [False]]], np.nan, first))
    assert hidden.counts.tolist() == [[0, 3]] * len(data)


def test_where_each_pose_is_visited_twice_no_visits_are_alone() -> None:
    """Then there is no group of them."""
    q = np.repeat([[0.0], [1.0]], 2, axis=0)
    same = SamePoses.of(q, np.ones((4, 1, 1)), np.zeros(4, dtype=bool), np.zeros(4, dtype=bool))
    V = np.ones((4, 1, 1))
    assert [len(visits) for visits, _ in same.together(V)] == [2]


def test_poses_are_the_same_where_they_are_near() -> None:
    """Wherever a grid's limits would be; and a path of small steps is more than one pose."""

    def numbers(q: Array) -> list[int]:
        one = np.ones((len(q), 1, 1))
        return SamePoses.of(q, one, *np.zeros((2, len(q)), dtype=bool)).pose.tolist()

    assert numbers(SAME_ANGLES * np.array([[500.49], [500.51], [502.0]])) == [0, 0, 1]
    rng = np.random.default_rng(1)
    written = np.deg2rad(rng.integers(-9000, 9000, (50, 6)) / 100 + 0.005)
    q = np.repeat(written, 2, axis=0) + 1e-9 * rng.standard_normal((100, 6))
    assert numbers(q) == np.repeat(np.arange(50), 2).tolist()
    # Of other poses, visits between two say nothing of these.
    between = SAME_ANGLES * np.array([[0.0, 0], [0.9, 7], [1.8, 0]])
    assert numbers(between) == [0, 1, 2]
    path = SAME_ANGLES * np.linspace(0, 8, 33)[:, None]
    assert np.bincount(numbers(path)).tolist() == [8, 8, 8, 8, 1]


def day(
    drawing_mm: float, moved: float = 0.0, changed_mm: float = 0.0, seed: int = 1
) -> tuple[MeasuredModel, MarkerPositions]:
    """Positions of markers without a load and with it, of a robot that errs anew in each pose.

    Args:
        drawing_mm: By how much.
        moved: How far the joints move between the two [rad].
        changed_mm: By how much coordinates err under the load besides.
        seed: Of the day.
    """
    rng, poses = np.random.default_rng(seed), 16
    parameters = all_parameters(SIX, MARKERS, (), SIX.joint_names, base=False, tool=False)
    model = MeasuredModel(SIX, OFFSETS, MARKERS, parameters)
    q = np.repeat(rng.uniform(*SIX.limits, (poses, 6)), 2, axis=0)
    q[1::2] += moved
    wrench = np.zeros((2 * poses, 6))
    wrench[1::2, :3] = 300 * rng.normal(size=(poses, 3))
    differs = np.zeros(2 * poses, dtype=bool)
    torque = loading_in(model.bending(K), q, wrench, AtTool(), differs)
    x = model.see(K, q, torque, derivatives=False).points
    x = x + np.repeat(1e-3 * drawing_mm * rng.standard_normal((poses, 3, 3)), 2, axis=0)
    x = x + 1e-3 * SIGMA * rng.standard_normal(x.shape)
    if changed_mm:
        x[1::2] += 1e-3 * changed_mm * rng.standard_normal(x[1::2].shape)
    row = np.repeat(np.arange(2 * poses)[:, None], 3, axis=1)
    return model, MarkerPositions(q, wrench, x, row, MARKERS)


def differences(data: MarkerPositions) -> MarkerPositions:
    """The same day, written as loaded readings less unloaded ones."""
    loaded = data[1::2]
    every = np.ones(len(loaded), dtype=bool)
    return replace(loaded, measured=loaded.measured - data.measured[::2], differs=every)


def fit_of(model: MeasuredModel, data: MarkerPositions, robust: bool = False) -> GeometricFit:
    """A fit by readings whose noise is known."""
    return fit_geometry(model, data, white(SIX, SIGMA), AtTool(), robust)


def springs(fit: GeometricFit) -> tuple[Array, Array]:
    """Compliances and their standard deviations, of the last parameters: forces tell three."""
    return fit.fitted.values[-3:], fit.fitted.std[-3:]


@pytest.mark.slow
@pytest.mark.parametrize("base", [False, True])
def test_two_readings_tell_springs_as_their_difference_does(base: bool) -> None:
    """Where the drawing errs by much, base and tool known or told by the positions."""
    model, data = day(drawing_mm=0.5)
    told, std = springs(fit_of(model, differences(data)))
    if base:
        model = model.with_parameters(all_parameters(SIX, MARKERS, (), SIX.joint_names))
    both = fit_of(model, data)
    k, spread = springs(both)
    # The rest is what the means say, and where the base is.
    assert k == pytest.approx(told, abs=0.2 * std.min())
    assert spread == pytest.approx(std, rel=0.02)
    assert both.fitted.noise.model_white == pytest.approx(0.5, rel=0.2)


@pytest.mark.slow
def test_where_the_drawing_is_exact_nothing_changes() -> None:
    """Positions that err by readings alone tell as much one by one."""
    model, data = day(drawing_mm=0.0)
    k, std = springs(fit_of(model, data))
    model, apart = day(drawing_mm=0.0, moved=2 * SAME_ANGLES)
    assert data.same_poses.groups
    assert not apart.same_poses.groups
    assert std == pytest.approx(springs(fit_of(model, apart))[1], rel=0.02)
    assert (np.abs(k - K[:3] / 1e-6) < 4 * std).all()


@pytest.mark.slow
def test_a_mean_is_left_out_as_a_pose_that_nobody_visited() -> None:
    """Bands are those of a pose that nobody visited, and coordinates of visits count once."""
    model, data = day(drawing_mm=0.5)
    fit = fit_of(model, data)
    half = fit.left_out_half * 1e3
    assert half == pytest.approx(np.full_like(half, 2 * 0.5), rel=0.35)
    of_base = model.with_parameters(all_parameters(SIX, MARKERS, ()))
    alone = fit_of(of_base, data[::2])
    assert fit.independent == pytest.approx(alone.independent, rel=0.05)
    others = fit_of(model, data[2:]).fitted.predict(data.q[:2], data.wrench[:2], AtTool())
    apart = data.measured[:2] - others.points
    assert fit.left_out[:2] == pytest.approx(apart, abs=2e-6)


@pytest.mark.slow
def test_bands_under_a_load_count_what_it_changes() -> None:
    """Of visits left out, and of other poses; and unloaded ones err by the drawing alone."""
    sizes, shares = [], []
    for seed in range(5):
        model, data = day(drawing_mm=0.1, changed_mm=0.3, seed=seed)
        every = model.with_parameters(all_parameters(SIX, MARKERS, (), SIX.joint_names))
        fit = fit_of(every, data)
        sizes.append(fit.fitted.noise.model_change[0])
        _, other = day(drawing_mm=0.1, changed_mm=0.3, seed=100 + seed)
        predicted = fit.fitted.predict(other.q, other.wrench, AtTool())
        left_out = np.abs(fit.left_out) <= fit.left_out_half
        both = (left_out, predicted.inside(other.measured))
        shares.append([one[i::2].mean() for one in both for i in range(2)])
    assert np.mean(sizes) == pytest.approx(0.3, rel=0.1)
    unloaded, loaded = np.mean(shares, axis=0).reshape(2, 2).T
    assert loaded == pytest.approx([0.95, 0.95], abs=0.03)
    # Means of pairs tell what the drawing errs by beside a quarter of the changes: Student's t.
    assert (unloaded > 0.92).all()


@pytest.mark.slow
def test_bands_know_from_how_few_pairs_a_change_is_told() -> None:
    """One marker in four poses with and without a load tells it with some ten degrees of freedom.

    Quantiles of a known size would hold 91 % of other readings.
    """
    inside = []
    for seed in range(16):
        model, data = day(drawing_mm=0.02, changed_mm=0.3, seed=seed)
        one = np.array([0])
        pairs = np.concatenate([np.arange(8), np.arange(8, 32, 2)])
        every = model.with_parameters(all_parameters(SIX, MARKERS, (), SIX.joint_names))
        fit = fit_of(every.of_markers(one), data[pairs].of_markers(one)).fitted
        other = day(drawing_mm=0.02, changed_mm=0.3, seed=100 + seed)[1].of_markers(one)[1::2]
        inside.append(fit.predict(other.q, other.wrench, AtTool()).inside(other.measured).mean())
        seen, motion, _, _ = fit.moves(other.q, other.wrench, AtTool())
        # Three springs are told by twelve coordinates; means tell a little more.
        differs = np.ones(len(other), dtype=bool)
        own = motion, seen.places, other.wrench
        assert 9 <= np.median(fit.dof(*own, differs)) < 12
        assert 9 <= np.median(fit.dof(*own)) < 14
        # Without a load bands are those of a robot whose changes nobody asks for.
        still = replace(fit, noise=fit.noise.without_changes).dof(*own)
        assert fit.dof(*own[:2]) == pytest.approx(still)
    assert np.mean(inside) > 0.92


@pytest.mark.slow
def test_scatter_that_nobody_stated_is_no_change_by_the_load() -> None:
    """Where readings scatter ten times as much as stated, bands of unloaded ones hold, too."""
    shares = []
    for seed in range(5):
        model, data = day(drawing_mm=0.0, seed=seed)
        every = model.with_parameters(all_parameters(SIX, MARKERS, (), SIX.joint_names))
        more = 1e-2 * SIGMA * np.random.default_rng(seed).standard_normal(data.measured.shape)
        fit = fit_of(every, replace(data, measured=data.measured + more))
        shares.append([(np.abs(fit.left_out) <= fit.left_out_half)[i::2].mean() for i in (0, 1)])
    assert (np.mean(shares, axis=0) > 0.85).all()


@pytest.mark.parametrize("changed_mm", [0.0, 0.3])
def test_a_posterior_counts_what_visits_of_a_pose_have_in_common(changed_mm: float) -> None:
    """It tells springs as well as the fit does, whose errors it samples."""
    model, data = day(drawing_mm=0.0, changed_mm=changed_mm)
    fit = fit_of(model, data)
    density = GeometryDensity.of(fit, AtTool(), robust=False)
    std = np.sqrt(np.diag(density.root @ density.root.T))
    assert std[-3:] == pytest.approx(springs(fit)[1], rel=0.12)


def test_where_nothing_is_placed_all_else_is_compared_with_the_drawing() -> None:
    """Visits of a pose are left out of a fit of no parameters, too: they are what they were."""
    model, data = day(drawing_mm=0.5)
    nothing = model.with_parameters(())
    errors = left_out_alone(nothing, np.zeros(0), data)
    seen = nothing.see(np.zeros(0), data.q, derivatives=False).points
    assert errors == pytest.approx(data.measured - seen, abs=1e-9)


@pytest.mark.slow
def test_a_wrong_visit_stands_out_of_its_pose() -> None:
    """Though the drawing errs by as much, and a robust fit trusts it less."""
    model, data = day(drawing_mm=0.5)
    sound = fit_of(model, data)
    assert sound.surprise.max() < 9 + 5 * np.sqrt(18)
    wrong = np.where(np.arange(len(data)) == 5, 0.3e-3, 0.0)[:, None, None]
    fit = fit_of(model, replace(data, measured=data.measured + wrong), robust=True)
    assert set(np.argsort(fit.surprise)[-2:]) == {4, 5}
    assert fit.surprise[5] > 1000
    assert fit.weights.argmin() == 5
    k, std = springs(fit)
    assert (np.abs(k - K[:3] / 1e-6) < 4 * std).all()


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [False, True])
def test_where_the_drawing_is_exact_only_the_wrong_visit_stands_out(hidden: bool) -> None:
    """A sound visit does not stand out with it, whether or not one of its markers is hidden."""
    model, data = day(drawing_mm=0.0)
    measured = data.measured.copy()
    measured[5] += 0.1e-3
    measured[4, 0] = np.nan if hidden else measured[4, 0]
    fit = fit_of(model, replace(data, measured=measured), robust=True)
    assert fit.surprise[5] > 1000
    assert np.delete(fit.surprise, 5).max() < 9 + 5 * np.sqrt(18)


@pytest.mark.parametrize("most", [1, 9])
def test_base_and_tool_alone_are_compared_by_poses_left_out_too(most: int) -> None:
    """Poses predict another one worse than those that were fitted, however often they were read."""
    model, data = day(drawing_mm=0.5)
    often = np.random.default_rng(2).integers(1, most + 1, data.seen.shape)
    data = replace(data, readings=often)
    every = model.with_parameters(all_parameters(SIX, MARKERS, (), SIX.joint_names))
    placed, start = place_robot(every, data)
    errors = left_out_alone(placed, start, data)
    others, there = place_robot(every, data[2:])
    expected = data[:2].measured - others.see(there, data.q[:2], derivatives=False).points
    assert errors[:2] == pytest.approx(expected, abs=2e-6)

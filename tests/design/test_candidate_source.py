"""Candidates of a source: feasible, repeatable on any number of cores, and even."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS, KR270, LOADED
from scipy.stats import kstest, qmc

from edtk.design.candidate_source import (
    IN_ANY_TIME,
    Candidates,
    CandidateSource,
    EmptyFeasibleSetError,
    sample_feasible,
)
from edtk.robots.constraints.height import Height
from edtk.robots.workspace import Workspace
from edtk.system.time_limit import time_limit

pytestmark = pytest.mark.slow

UNBOUNDED = replace(KR270, workspace=Workspace(KR270.workspace.robot))
on_each = pytest.mark.parametrize("space", DESIGNS.values(), ids=DESIGNS)
on_every_load = pytest.mark.parametrize("space", LOADED.values(), ids=LOADED)
either = pytest.mark.parametrize("sampling", ["random", "sobol"])


@pytest.fixture(autouse=True)
def _many_small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks small enough that a thousand candidates come from many of them."""
    monkeypatch.setattr("edtk.design.candidate_source.SAMPLES_AT_ONCE", 256)


def cube(space, x):
    """What is drawn as points of the unit cube, where the bounds alone confine it."""
    lower, upper = space.limits[:, space.drawn]
    return (x[:, space.drawn] - lower) / (upper - lower)


def same(a: Candidates, b: Candidates) -> None:
    np.testing.assert_array_equal(a.x, b.x)
    np.testing.assert_array_equal(a.problem.packed, b.problem.packed)


@either
@on_every_load
def test_all_feasible(space, sampling):
    """A source gives as many experiments as asked for; each is feasible, and fixed joints stay."""
    x = CandidateSource(space, 0, sampling).take(1000).x
    n = space.workspace.robot.n
    assert x.shape == (1000, space.size)
    assert space.at(x).feasible.all()
    assert space.workspace.contains(x[:, :n]).all()
    held = np.setdiff1d(np.arange(n), space.free)
    np.testing.assert_array_equal(x[:, held], np.tile(space.fixed[held], (1000, 1)))
    spread = np.ptp(cube(space, x), axis=0)
    assert (spread[: len(space.free)] > 0.9).all()
    assert (
        spread[len(space.free) :] > 0.4
    ).all()  # within their bounds all free forces come round more than once


@either
@on_every_load
def test_information_is_that_of_the_regressor(space, sampling):
    """Each candidate's information is A'A/sigma^2 with the model's regressor, to rounding."""
    candidates = CandidateSource(space, 1, sampling).take(300)
    n = space.workspace.robot.n
    q = candidates.x[:, :n]
    wrench = space.load.wrench(candidates.x[:, n:])
    A = space.model.regressor(q, wrench) / space.sigma[:, None]
    expected = np.swapaxes(A, 1, 2) @ A
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert (np.abs(candidates.problem.blocks() - expected) <= 1e-12 * scale).all()
    assert candidates.problem.parameters == space.model.parameters


@either
def test_seeded(sampling):
    """The seed, of one number or several, decides the sequence."""
    source = CandidateSource(KR270, (4, 1), sampling)
    same(source.take(300), CandidateSource(KR270, (4, 1), sampling).take(300))
    for seed in (4, (4, 2), (5, 1)):
        assert (replace(source, seed=seed).take(300).x != source.take(300).x)[:, KR270.free].all()


@either
@on_every_load
def test_a_smaller_number_is_the_head_of_a_larger_one(space, sampling):
    """The first n candidates do not depend on how many are asked for in all."""
    source = CandidateSource(space, 5, sampling)
    many = source.take(1500)
    for n in (1, 255, 256, 257, 700):
        same(source.take(n), many[np.arange(n)])


@either
@on_each
@pytest.mark.parametrize("workers", [2, 4, None])
def test_the_number_of_workers_does_not_matter(space, sampling, workers):
    """One, two and four threads, and one a core, give the same candidates in the same order."""
    alone, beside = (
        CandidateSource(space, 6, sampling, workers=k).take(1500) for k in (1, workers)
    )
    same(alone, beside)


@on_each
def test_chunks_are_the_candidates(space):
    """All chunks together are the candidates that `take` returns, and no chunk is empty."""
    source = CandidateSource(space, 7)
    n = 1000
    chunks = list(source.chunks(n))
    assert len(chunks) > 2
    assert all(len(chunk.x) == chunk.problem.n > 0 for chunk in chunks)
    whole = source.take(n)
    np.testing.assert_array_equal(np.concatenate([chunk.x for chunk in chunks]), whole.x)
    packed = np.concatenate([chunk.problem.packed for chunk in chunks], axis=1)
    np.testing.assert_array_equal(packed, whole.problem.packed)
    np.testing.assert_array_equal(sample_feasible(space, n, 7), whole.x)


def test_a_source_that_is_not_read_to_its_end_can_be_read_again():
    """An abandoned pass over the chunks leaves no trace in the next one."""
    source = CandidateSource(KR270, 8)
    first = next(source.chunks(10_000))
    np.testing.assert_array_equal(next(source.chunks(10_000)).x, first.x)


@either
@pytest.mark.parametrize("seed", range(3))
def test_uniform_where_nothing_constrains(sampling, seed):
    """Without constraints each joint is uniform: Kolmogorov's statistic is below 2.6/sqrt(n).

    Random numbers exceed that with probability 2 exp(-2 * 2.6^2) = 3e-6 per joint; Sobol's points
    lie closer.
    """
    n = 5000
    points = cube(UNBOUNDED, CandidateSource(UNBOUNDED, seed, sampling).take(n).x)
    assert max(kstest(x, "uniform").statistic for x in points.T) < 2.6 / np.sqrt(n)


@pytest.mark.parametrize("seed", range(3))
def test_sobol_is_more_even_than_random(seed):
    """The centred discrepancy of 1024 Sobol points is below a tenth of that of random ones.

    Of random points the mean square discrepancy falls as 1/n, of scrambled nets as n^-3 up to
    logarithms.
    """
    points = {
        s: cube(UNBOUNDED, CandidateSource(UNBOUNDED, seed, s).take(1024).x)
        for s in ("random", "sobol")
    }
    assert qmc.discrepancy(points["sobol"]) < 0.1 * qmc.discrepancy(points["random"])


@either
def test_all_that_is_feasible_among_the_points_of_the_cube(sampling):
    """The candidates are the feasible points of an unconstrained source of the same seed."""
    points = CandidateSource(UNBOUNDED, 11, sampling).take(10_000).x
    feasible = points[KR270.workspace.contains(points)]
    assert 1000 < len(feasible) < 9000
    np.testing.assert_array_equal(
        CandidateSource(KR270, 11, sampling).take(len(feasible)).x, feasible
    )


@either
def test_empty_set_names_the_constraint(sampling):
    """Where no pose is feasible the constraint that excludes all of them is named.

    The error carries the same as data, also from one process to another.
    """
    space = replace(KR270, workspace=Workspace(KR270.workspace.robot, (Height(0.8), Height(9.0))))
    source = CandidateSource(space, sampling=sampling, patience=3)
    with pytest.raises(
        EmptyFeasibleSetError, match=r"among 768 samples.*height p_z > 9000 mm.*100 %"
    ):
        source.take(1)
    with pytest.raises(EmptyFeasibleSetError) as caught:
        next(source.chunks(1))
    error = pickle.loads(pickle.dumps(caught.value))
    assert (error.samples, error.share) == (768, 1.0)
    assert error.constraint in space.labels
    assert str(error) == str(caught.value)


def test_patience_ends_with_the_first_feasible_pose():
    """A rare feasible set that is found within the patience is sampled for as long as it takes."""
    rare = replace(
        KR270,
        workspace=Workspace(KR270.workspace.robot, (*KR270.workspace.constraints, Height(2.9))),
    )
    q = CandidateSource(rare, 0, patience=40).take(30).x
    assert rare.workspace.contains(q).all()
    assert len(q) == 30


@pytest.mark.parametrize("n", [0, -1])
@pytest.mark.parametrize("ask", ["take", "chunks", "sample_feasible"])
def test_no_candidates_are_rejected(n, ask):
    """Fewer than one candidate is rejected, however they are asked for."""
    source = CandidateSource(KR270)
    calls = {
        "take": lambda: source.take(n),
        "chunks": lambda: list(source.chunks(n)),
        "sample_feasible": lambda: sample_feasible(KR270, n, 0),
    }
    with pytest.raises(ValueError, match="at least one"):
        calls[ask]()


def test_ctrl_c_while_threads_end(monkeypatch):
    """An interruption in the last wait for the threads reaches the caller; it was swallowed."""

    class Interrupted(ThreadPoolExecutor):
        def shutdown(self, *args, **options):
            super().shutdown(*args, **options)
            raise KeyboardInterrupt

    monkeypatch.setattr("edtk.design.candidate_source.ThreadPoolExecutor", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        CandidateSource(KR270, 0).take(1000)


def test_a_seed_may_be_any_whole_number() -> None:
    """The numbers of a seed stay whole, beyond those of 64 bits too."""
    for seed in (3, 2**63, np.int64(5), (2**64, 1)):
        found = CandidateSource(None, seed).seeds
        assert all(isinstance(number, int) for number in found)
        np.random.default_rng((*found, 1))


def test_where_time_is_over_the_first_candidates_are_enough() -> None:
    """They are the beginning of the sequence; who does not ask for that gets all of them."""
    source = CandidateSource(KR270, 0)
    n = 3 * IN_ANY_TIME
    with time_limit(0.0):
        some = source.take(n, in_time=True)
        assert IN_ANY_TIME <= len(some.x) < n
        assert len(source.take(n).x) == n
    same(some, source.take(len(some.x)))
    assert len(source.take(n, in_time=True).x) == n

"""The simulation of calibrations with a tracker's noise, and what that noise costs, run small."""

import numpy as np


def test_covariance(script):
    """The sample covariance of few simulated calibrations is M^-1, within their chance."""
    study_of = script("tracker_noise.py")
    study = study_of.tracked_robots()["7R arm, 14 kg"]
    plan = study_of.random_plan(study, 1)
    k = study_of.estimates(study, plan, 1000, 2)
    variance, matrix, white, bias = study_of.compared(study, plan, k)
    chance = np.sqrt(2 / 1000)
    assert variance < 4 * chance
    assert matrix < 4 * chance
    assert bias < 0.2
    assert white > 1.2


def test_costs(script):
    """Candidates and relaxations of the benchmark can be drawn and solved."""
    benchmark = script("benchmarks/noise.py")
    study = benchmark.tracked_robots()[benchmark.ARM]
    table, ratio = benchmark.candidates_table(study, 200, 1)
    assert "tracker" in table
    assert ratio > 0
    problem, _ = benchmark.drawn(study, 200)
    assert benchmark.solved(study, problem, "D", 1) > 0

"""Candidates, relaxations and plans are free, and say which bound holds with the cell."""

import json
from dataclasses import replace

import numpy as np
import pytest

import edtk
from edtk.cell.shapes import Body, Box
from edtk.certificate.certificate import certificate
from edtk.certificate.verify_certificate import verify_certificate
from edtk.design.candidate_source import CandidateSource, NothingFreeError
from edtk.design.exact import day_search
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.robots.rotations import transform
from edtk.study.plan_study import plan_study, relax_study, source_of
from edtk.study.study import load_study
from edtk.system.errors import UserError
from tests.support.cells import STUDY, milling

pytestmark = pytest.mark.usefixtures("sharp_bounds")

SIZE = 4


@pytest.fixture(scope="module")
def study():
    return milling()


@pytest.fixture(scope="module")
def plan(study):
    return plan_study(study, SIZE, "D")


def cell_of(study):
    return study.space.clear.cell


def test_candidates_are_the_free_ones_of_those_without_the_cell(study):
    source = CandidateSource(study.space, 1)
    found = source.take(100).x
    every = source.without_cell.take(300).x
    free = study.space.clear.slack(study.robot.frames(every[:, :6]))[0] >= 0
    assert 100 < free.sum() < 290
    count = min(len(found), int(free.sum()))
    assert (found[:count] == every[free][:count]).all()
    assert cell_of(study).free(found[:, :6]).all()


def test_a_plan_is_free_and_has_both_bounds(plan):
    assert plan.in_cell.free
    assert plan.in_cell.clearance.least.min() >= 0
    without = plan.certified
    # A bound over more poses is no sharper.
    assert plan.bound <= without.bound * (1 + 1e-6)
    assert 0.5 < without.efficiency <= plan.efficiency + 1e-6 <= 1 + 2e-6


def test_the_bound_without_the_cell_is_that_of_the_same_study_without_one(study, plan):
    open_study = load_study(STUDY).replace(candidates=300, starts=16)
    alone = relax_study(open_study, "D", continuous=True)
    assert plan.relaxed.without_cell.best_bound.cost == alone.best_bound.cost


def test_the_weights_of_a_relaxation_are_on_free_poses(study):
    found = relax_study(study, "D")
    assert cell_of(study).free(found.x[:, :6]).all()
    assert found.gap < 1e-5
    assert found.certify()[1] == pytest.approx(found.proved_bound.cost, rel=1e-9)


def test_a_relaxation_in_a_cell_is_stored_with_both_bounds(study, plan):
    data = json.loads(json.dumps(plan.relaxed.to_dict()))
    again = RelaxedPlan.from_dict(plan.relaxed.source, plan.relaxed.criterion, data)
    assert again.to_dict() == plan.relaxed.to_dict()
    assert again.without_cell.source.space.clear is None
    assert again.source.space.clear is not None


def test_a_certificate_proves_the_bound_without_the_cell(study, plan):
    content = certificate(study, plan)
    found = verify_certificate(content)
    assert found.valid
    assert content["claims"]["bound_searched"] == pytest.approx(plan.certified.bound)


def test_a_certificate_holds_where_time_ends_between_both_searches(study, monkeypatch):
    relaxed_in_time = day_search.relaxed_in_time

    def ended(*arguments):
        relaxed, interrupted = relaxed_in_time(*arguments)
        free = replace(relaxed.on_candidates, without_cell=relaxed.without_cell)
        return free, interrupted

    monkeypatch.setattr(day_search, "relaxed_in_time", ended)
    found = plan_study(study, SIZE, "D")
    made = certificate(study, found)
    assert "bound_searched" not in made["claims"]
    assert made["proof"]["searched"] == []
    assert verify_certificate(made).valid


def test_words_say_which_bound_is_with_the_cell(plan):
    text = plan.summary()
    assert "not proved, with the cell)" in text
    assert "without the cell the bound is" in text
    assert "mm or more beyond the margin of 20 mm" in text
    data = plan.to_dict()
    assert data["cell"]["free"] is True
    assert len(data["cell"]["poses"]) == len(plan.whole.q)
    assert data["without_cell"]["efficiency"] <= data["efficiency"] + 1e-6


def test_a_cell_in_which_no_pose_is_free_is_one_line_that_names_what_is_in_the_way():
    wall = Body("wall", None, (Box(transform(position=[0.35, 0, 0.75]), np.full(3, 0.3)),))
    study = milling(more=(wall,))
    with pytest.raises(NothingFreeError, match=r"each of .* and wall are nearest"):
        CandidateSource(study.space, 1).take(10)
    with pytest.raises(UserError, match=r"^Study: scene: no pose is free") as refused:
        relax_study(study, "D")
    assert "\n" not in str(refused.value)


def test_a_plan_stays_free_where_the_best_poses_touch(study, plan):
    open_plan = plan_study(without_cell(study), SIZE, "D")
    assert not cell_of(study).free(open_plan.whole.q).all()
    assert plan.certified.efficiency < open_plan.efficiency - 1e-3
    assert plan.efficiency > 0.95


def without_cell(study):
    """The study without its cell."""
    other = load_study(STUDY).replace(candidates=300, starts=16)
    other.__dict__["space"] = replace(study.space, clear=None)
    return other


def test_a_source_draws_the_same_free_poses_whatever_the_size_of_its_chunks(study):
    source = source_of(study)
    few, many = source.take(20).x, source.take(300).x
    assert (few == many[:20]).all()


SCENE = {
    "margin_mm": 20,
    "box": [{"name": "block", "size_mm": [700, 700, 700], "position_mm": [1900, 0, 1600]}],
}


def test_a_test_pose_that_touches_is_a_warning_and_no_error():
    study = load_study(STUDY).replace(scene=SCENE)
    words = [one.words for one in study.warnings]
    assert study.cell is not None
    q = np.deg2rad(study.specification.test_poses[0].q_deg)
    assert not study.cell.free(q)
    assert any(
        word.startswith("test_pose: in the cell, with the calibration tool") for word in words
    )
    assert any("and block are" in word for word in words)


@pytest.mark.slow
def test_a_run_in_a_cell_reports_it_and_a_changed_cell_is_another_run(tmp_path):
    keys = {"optimise": ["D"], "criteria": ["D"], "sizes": [3], "candidates": 100, "starts": 16}
    study = load_study(STUDY).replace(scene=SCENE, published=[], **keys)
    run = edtk.run(study, tmp_path)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "over all free poses, with the cell" in text
    assert "In the cell all " in text
    assert run.relaxations["D"].without_cell is not None
    wider = study.replace(scene=SCENE | {"margin_mm": 21})
    assert wider.cell.digest != study.cell.digest

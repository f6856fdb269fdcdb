"""What is proved of all plans on a study's candidates, beside a plan that may be off them."""

import json
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
import pytest
from arm import arm
from geometry_sheets import run
from loaded_arm import STUDY

import edtk
from edtk.design.exact import prove_exact
from edtk.system.errors import UserError

pytestmark = pytest.mark.slow

KINDS = {"springs": arm(candidates=100), "parameters": STUDY}


def least_cost(found, size, candidates):
    """The least cost of all plans of the first candidates."""
    relaxed = found.relaxed
    problem = relaxed.source.take(candidates).problem
    plans = np.array(list(combinations_with_replacement(range(candidates), size)))
    M = problem.with_prior(None).plan_information(plans, np.ones(plans.shape))
    if problem.prior is not None:
        M = M + size * problem.prior
    return float(relaxed.criterion.cost(M).min())


@pytest.mark.cell("`plan --prove` and `--candidates`")
@pytest.mark.parametrize("kind", KINDS)
def test_the_best_plan_on_candidates_is_proved(kind: str) -> None:
    """It is the best of all plans on them, in numbers and words, and the bound is not above it."""
    size, candidates = 4, 12
    found = edtk.plan(KINDS[kind], size, "D", workers=1, prove=60, candidates=candidates)
    one = found.on_candidates
    assert one is not None
    assert one.proved
    assert one.best == pytest.approx(least_cost(found, size, candidates), rel=1e-9)
    assert one.best * (1 - 3e-9) <= one.bound.cost <= one.best
    assert one.plan.experiments == size
    text = str(found.summary())
    assert "proved: the best of all plans of 4 experiments on these 12 candidates" in text
    assert "% better, off the candidates" in text
    assert found.to_dict()["proved_exact"] is True
    assert found.to_dict()["bound_exact"] == one.bound.value


def test_a_proof_without_time_says_what_it_leaves() -> None:
    """The bound of the root stands beside the best plan that is known."""
    found = edtk.plan(KINDS["springs"], 7, "A", workers=1, prove=0)
    one = found.on_candidates
    assert one is not None
    assert not one.proved
    assert one.candidates == 100
    assert one.bound.cost < one.best
    text = str(found.summary())
    assert "proved: none of all plans of 7 experiments on these 100 candidates is better" in text
    assert f"{100 * one.bound.gap_to(one.best):.2g} % from that" in text


def test_kept_experiments_count() -> None:
    """The proof is of the new experiments, beside those that were made before."""
    study = KINDS["springs"]
    kept = edtk.plan(study, 3, "D", workers=1).whole
    found = edtk.plan(study, 5, "D", workers=1, keep=kept, prove=60, candidates=20)
    one = found.on_candidates
    assert one is not None
    assert one.plan.experiments == 2
    assert one.best == pytest.approx(least_cost(found, 2, 20), rel=1e-9)


def test_ctrl_c_keeps_the_bound_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupted proof leaves plan and bound."""

    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(prove_exact._Search, "_divide", interrupt)
    found = edtk.plan(KINDS["springs"], 5, "A", workers=1, prove=60)
    one = found.on_candidates
    assert one is not None
    assert one.ended == "interrupted"
    assert 0 < one.bound.cost < one.best


def test_the_command_answers_and_says_what_is_wrong(tmp_path: Path) -> None:
    """JSON has the names that others rely on; mistakes are one line, before a search."""
    path = tmp_path / "study.toml"
    KINDS["springs"].to_toml(path)
    for words, said in (
        (("--prove", "5", "--criterion", "O4"), "O4"),
        (("--candidates", "9"), "--candidates: plans move off the candidates; expected prove"),
        (("--prove", "-1"), "--prove"),
    ):
        code, out, err = run("plan", path, "--size", "4", *words)
        assert (code, out, err.strip().count("\n")) == (2, "", 0)
        assert said in err
    words = ("--prove", "60", "--candidates", "10", "--criterion", "D", "--workers", "1", "--json")
    code, out, _ = run("plan", path, "--size", "3", *words)
    assert code == 0
    answer = json.loads(out)
    assert answer["proved_exact"] is True
    # D is maximised: no plan has more.
    assert answer["on_candidates"]["value"] <= answer["bound_exact"] * (1 + 1e-12)
    assert answer["on_candidates"]["candidates"] == 10


def test_problems_and_regions_have_no_candidates_to_draw() -> None:
    """The number of candidates is a study's to say."""
    with pytest.raises(UserError, match="not for plans of a problem"):
        edtk.plan(edtk.Problem(np.eye(2)[:, None, :]), 3, candidates=5)

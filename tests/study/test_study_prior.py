"""The prior of a study, from its own table or from an earlier calibration's file."""

import json
from pathlib import Path

import numpy as np
import pytest

from edtk.study.study import load_study
from edtk.study.study_parts import study_prior
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate

PAPER = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"
K = [3.1e-7, 4.2e-7, 2.7e-6, 2.9e-6, 2.2e-6]


@pytest.fixture
def with_prior(tmp_path):
    """The example with a line in its [prior] table and an earlier calibration beside it."""
    found = evaluate(load_study(PAPER), load_study(PAPER).published_plans()["table_4_3"])
    std = np.sqrt(np.diag(found.covariance))
    content = {
        "k": dict(zip(["q2", "q3", "q4", "q5", "q6"], K, strict=True)),
        "std": std.tolist(),
        "correlation": (found.covariance / np.outer(std, std)).tolist(),
    }
    (tmp_path / "k.json").write_text(json.dumps(content))
    (tmp_path / "bare.json").write_text(json.dumps(content["k"]))
    text = PAPER.read_text(encoding="utf-8")
    head, rest = text.split("published = [")

    def load(line):
        path = tmp_path / "study.toml"
        path.write_text(f"{head}{rest.split(']', 1)[1]}\n[prior]\n{line}\n", encoding="utf-8")
        return load_study(path)

    return load, found.covariance


@pytest.mark.cell("an earlier result as a prior", "springs")
def test_an_earlier_calibration_is_read_from_its_file(with_prior):
    """The prior is normal, with the means and the covariance that `edtk identify` wrote."""
    load, covariance = with_prior
    prior = study_prior(load('earlier_file = "k.json"'))
    np.testing.assert_allclose(prior.earlier.mean, K)
    np.testing.assert_allclose(prior.earlier.covariance, covariance, rtol=1e-9)


def test_what_the_bound_and_an_estimated_sigma_leave(with_prior, tmp_path):
    """The mean is that without the bound k >= 0; few degrees of freedom widen the covariance."""
    load, covariance = with_prior
    content = json.loads((tmp_path / "k.json").read_text())
    unbounded = dict(zip(content["k"], [*K[:4], -1e-8], strict=True))
    (tmp_path / "k.json").write_text(
        json.dumps(content | {"k_unbounded": unbounded, "covariance_dof": 4})
    )
    prior = study_prior(load('earlier_file = "k.json"'))
    np.testing.assert_allclose(prior.earlier.mean, [*K[:4], -1e-8])
    np.testing.assert_allclose(prior.earlier.covariance, 2 * covariance, rtol=1e-9)
    (tmp_path / "k.json").write_text(json.dumps(content | {"covariance_dof": 1}))
    with pytest.raises(UserError, match="covariance_dof above 2"):
        study_prior(load('earlier_file = "k.json"'))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('earlier_file = "absent.json"', r"prior\.earlier_file: absent.json: no such file"),
        (
            'earlier_file = "bare.json"',
            "prior.earlier_file: bare.json: expected a positive definite covariance",
        ),
        (
            'earlier_file = "k.json"\nearlier = { mean_rad_per_Nm = {}, covariance = [] }',
            "one of earlier and earlier_",
        ),
    ],
)
def test_mistakes(with_prior, line, words):
    """A file that is not there, has no covariance, or stands beside a table, is refused."""
    with pytest.raises(UserError, match=words):
        study_prior(with_prior[0](line))


def test_an_impossible_certainty_is_refused(tmp_path):
    """Squares of such standard deviations vanish, and their inverses overflow."""
    names = ("q2", "q3", "q4", "q5", "q6")
    earlier = {
        "mean_rad_per_Nm": dict.fromkeys(names, 1e-6),
        "covariance": (1e-200 * np.eye(5)).tolist(),
    }
    study = load_study(PAPER).replace(prior={"earlier": earlier})
    with pytest.raises(
        UserError, match=r"prior\.earlier\.covariance: expected standard dev.* 1e-20"
    ):
        study_prior(study)
    (tmp_path / "k.json").write_text(
        json.dumps({"k": dict.fromkeys(names, 1e-6), "std": dict.fromkeys(names, 1e-100)})
    )
    study = study.replace(prior={"earlier_file": str(tmp_path / "k.json")})
    with pytest.raises(UserError, match=r"prior\.earlier_file: .*k\.json: expected standard dev"):
        study_prior(study)

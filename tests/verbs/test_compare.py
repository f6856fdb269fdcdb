"""Designs side by side."""

import numpy as np
import pytest
from matplotlib import pyplot

import edtk
from edtk.system.errors import ArgumentError

X = np.linspace(-1.0, 1.0, 11)
PARABOLA = edtk.Problem(np.vander(X, 3)[:, None, :])
MINE = {"even": [0, 2, 4, 6, 8, 10], "ends": [0, 0, 5, 5, 10, 10]}
PLAN = "studies/plans/table_4_3.csv"
STUDY = "studies/kr270_milling.toml"


@pytest.mark.slow
def test_values_and_efficiencies_are_those_of_arithmetic(tmp_path):
    """Of indices, plans and weights, under D, A and the largest prediction."""
    weights = edtk.relax(PARABOLA, "A")
    page = tmp_path / "page.html"
    found = edtk.compare({**MINE, "weights": weights}, PARABOLA, out=page)
    table = found.to_frame()
    for name, chosen in MINE.items():
        rows = np.vander(X[chosen], 3)
        cov = np.linalg.inv(rows.T @ rows)
        assert table.loc[name, "A"] == pytest.approx(np.trace(cov), rel=1e-12)
        assert table.loc[name, "efficiency A"] == pytest.approx(8 / 6 / np.trace(cov), rel=1e-7)
        best = 6 * (4 / 27) ** (1 / 3)
        share = np.linalg.det(cov) ** (-1 / 3) / best
        assert table.loc[name, "efficiency D"] == pytest.approx(share, rel=1e-7)
        every = np.vander(X, 3)
        largest = np.einsum("ip,pq,iq->i", every, cov, every).max()
        assert table.loc[name, "efficiency prediction_G"] == pytest.approx(0.5 / largest, rel=1e-9)
    assert table.loc["weights", "efficiency A"] == pytest.approx(1, rel=1e-7)
    assert "weights is at least 75.0% efficient" in found.headline()
    assert "Fraction of design space" in page.read_text()
    edtk.compare(MINE, PARABOLA, criteria=["E"], out=tmp_path / "table.csv")
    assert (tmp_path / "table.csv").read_text().splitlines()[
        0
    ] == "design,experiments,E,efficiency E"
    assert found.plot().images[0].get_array().shape == (3, len(found.criteria))
    assert "weights" in found.summary()
    assert "weights" in found._repr_html_()
    pyplot.close("all")


@pytest.mark.slow
def test_plans_of_a_study_are_under_its_criteria(tmp_path):
    """Values are those of `edtk.evaluate`, and the best plan of each criterion has all."""
    found = edtk.compare([PLAN], STUDY, criteria=["D", "rho0"], out=tmp_path / "page.html")
    assert found.names == ("1 table_4_3",)
    values = edtk.evaluate(STUDY, PLAN).criteria
    assert found.values.tolist() == [[values["D"], values["rho0"]]]
    assert (found.efficiencies == 1).all()


@pytest.mark.parametrize(
    ("designs", "options", "words"),
    [
        ([], {}, "designs: expected at least one"),
        (3, {}, "designs: expected a list of designs"),
        (
            [[0, 5, 10]],
            {},
            "designs 1: expected a plan or weights; plans of a robot need their study",
        ),
        ([[0, 5, 11]], {"model": PARABOLA}, "designs 1: expected indices of candidates, from 0 to"),
        ([[0.5]], {"model": PARABOLA}, "designs 1: expected indices"),
        ({"mine": [0, 0]}, {"model": PARABOLA}, "designs mine: tells too little for a value"),
        (MINE, {"model": PARABOLA, "out": "x.txt"}, "out x.txt: expected a file"),
        ([PLAN], {"model": STUDY, "criteria": ["I"]}, "criteria I: expected some of A, D"),
    ],
)
def test_what_makes_no_sense_is_refused(designs, options, words):
    """One line names the argument."""
    with pytest.raises(ArgumentError, match=words):
        edtk.compare(designs, **options)


def test_designs_of_other_models_are_refused():
    """Their parameters differ."""
    line = edtk.Problem(np.vander(X, 2)[:, None, :])
    with pytest.raises(ArgumentError, match="designs 2 D: has the parameters k1, k2; expected"):
        edtk.compare([edtk.relax(PARABOLA, "D"), edtk.relax(line, "D")])

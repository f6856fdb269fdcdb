"""What a kind of question does not answer is refused in one table, with its reason."""

import inspect
import re

import numpy as np
import pytest
from small_arm import ROBOT

import edtk
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.verbs.bayes import Sampling
from edtk.verbs.of_kinds import question_of
from edtk.verbs.question import REFUSED

MEASURED = {"robot": ROBOT, "measurement": {"sigma_mm": 0.05}, "load": {"F_N": [0, 0, -100]}}
MARKER = {"name": "A", "position_mm": [90, 10, 50]}
X = np.linspace(-1.0, 1.0, 11)
ASKED = {
    "problem": edtk.Problem(np.stack([np.ones(11), X], axis=-1)[:, None, :]),
    "region": edtk.Region(lambda x: np.stack([np.ones(len(x)), x[:, 0]], axis=-1), -1, 1),
    "compliances": Study(
        **MEASURED, tool={"position_mm": [100, 0, 50]}, joints={"unknown": ["q1", "q2"]}
    ),
    "geometry": Study(**MEASURED, parameters={"geometry": "all"}, marker=[MARKER]),
}
REFUSALS = [
    (kind, verb, option, reason)
    for kind, verbs in REFUSED.items()
    for verb, options in verbs.items()
    for option, reason in options.items()
]
SHEET = {"measurements": "no.csv"}
NEEDED = {"plan": {"size": 4}, "template": {"plan": "no.csv"}, "identify": SHEET}
# What is of a wrong type is said before what is not answered.
OF_ITS_TYPE = {
    "exclude": "no.csv",
    "dask": "tcp://no:1",
    "detect": {"drift": "1mm"},
    "place_tracker": True,
    "placed_study": "no.toml",
    "rest": "no.csv",
    "certificate": "no.json",
    "positions": True,
    "linear": True,
}
NEEDED["predict"] = {"result": {}, "poses": "no.csv"}


@pytest.mark.parametrize("kind", ASKED)
def test_each_kind_asks_its_own_question(kind):
    """Whatever is asked, the question knows its row of the table."""
    assert question_of(ASKED[kind]).kind == kind
    assert set(ASKED) == set(REFUSED)


@pytest.mark.parametrize(("kind", "verb", "option", "reason"), REFUSALS)
def test_refused_options_exist_and_say_why(kind, verb, option, reason):
    """Each entry is an option of its verb, which says the reason before any work or file."""
    call = getattr(edtk, verb)
    given = NEEDED.get(verb, {}) | {option: OF_ITS_TYPE.get(option, 1)}
    if option in ("chain", "export"):
        given = NEEDED[verb] | {"bayes": Sampling(**{option: "no.nc"})}
    else:
        assert option in inspect.signature(call).parameters
    with pytest.raises(ArgumentError, match=f"^{option}: {re.escape(reason)}"):
        call(ASKED[kind], **given)

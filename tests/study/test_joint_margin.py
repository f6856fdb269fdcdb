"""Plans keep their margin from the joints' limits, and say where a joint stands on one."""

from pathlib import Path

import numpy as np
import pytest
from short_search import short_search

import edtk
from edtk.certificate.case import Case
from edtk.certificate.certificate import certificate_text
from edtk.design.plan import Plan
from edtk.robots.workspace import joints_on_limits, on_limits_in_words
from edtk.system.parsing import parse_json

PATH = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"
STUDY = edtk.load_study(PATH)
JOINTS = STUDY.to_dict()["joints"]
NEAR = STUDY.replace(joints={**JOINTS, "margin_deg": 3})


@pytest.mark.slow
def test_a_plan_keeps_the_margin_and_says_so_without(tmp_path: Path) -> None:
    """The search stands on limits unless there is a margin; then nothing is nearer than it."""
    with short_search():
        plain = edtk.plan(STUDY, 4, seed=1)
        kept = edtk.plan(NEAR, 4, seed=1, certificate=tmp_path / "c.json")
    assert "q2" in plain.on_limits
    assert "on their limits: q2 in row" in plain.summary()
    assert plain.to_dict()["on_limits"]["q2"] == [row + 1 for row in plain.on_limits["q2"]]
    lower, upper = STUDY.robot.limits
    q = kept.whole.q[:, 1:]
    assert np.minimum(q - lower[1:], upper[1:] - q).min() > np.deg2rad(3) - 1e-9
    assert kept.on_limits == {}
    assert "on their limits" not in kept.summary()
    assert edtk.verify(tmp_path / "c.json", NEAR).valid
    assert not edtk.verify(tmp_path / "c.json", STUDY).valid
    text = certificate_text(NEAR, kept)
    near = Case.from_dict(parse_json(text, "c")).setting
    on_limit = np.where(np.arange(6) == 1, STUDY.robot.limits[1], kept.whole.q)
    assert (near.violation(on_limit) > 0.05).all()


def test_poses_that_were_measured_may_be_nearer() -> None:
    """A margin is for plans to come: kept poses and test poses on limits are taken."""
    q = STUDY.published_plans()["table_4_2"].q.copy()
    table = Plan(q, np.tile([0, 0, -2500.0, 0, 0, 0], (len(q), 1)), np.ones(len(q), int))
    sheet = table.to_frame(STUDY.robot)
    assert NEAR.load_plan(sheet).experiments == STUDY.load_plan(sheet).experiments


def test_a_margin_without_room_is_refused() -> None:
    """It is one line that names the joint and the key."""
    study = STUDY.replace(joints={**JOINTS, "margin_deg": 80})
    with pytest.raises(edtk.UserError, match=r"joints.margin_deg: leaves no range for joint 'q2'"):
        edtk.plan(study, 4)


def test_joints_on_limits_are_named_with_their_rows() -> None:
    """Fixed joints do not count, and long lists are cut."""
    lower, upper = STUDY.robot.limits
    q = np.tile((lower + upper) / 2, (7, 1))
    q[1, 1] = lower[1] + np.deg2rad(0.01)
    q[:6, 4] = upper[4]
    q[2, 0] = upper[0]
    found = joints_on_limits(STUDY.robot, q, frozenset([0]))
    assert found == {"q2": [1], "q5": [0, 1, 2, 3, 4, 5]}
    words = on_limits_in_words(found)
    assert words.startswith("on their limits: q2 in row 2; q5 in rows 1, 2, 3, 4 and 2 more (")
    assert on_limits_in_words({}) == ""

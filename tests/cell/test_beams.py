"""Beams against the bodies of a cell: by hand, by differences, and by a second implementation."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from edtk import Study
from edtk.cell.beams import Beams
from edtk.cell.cell import _Standing
from edtk.cell.plan_check import PlanCheck, Seen
from edtk.cell.shapes import Box, Cylinder
from edtk.cell.sight import AllSeen, Sight
from edtk.certificate.certificate import setting_to_dict
from edtk.certificate.recompute.setting import Setting
from edtk.report.views.day import plan_check_text
from edtk.system.errors import UserError
from edtk.system.typing import Array

WALL = {"name": "wall", "size_mm": [100, 3000, 3000], "position_mm": [3500, 2000, 1500]}
KEYS = {
    "robot": "kuka_kr270",
    "tool": {"position_mm": [611.5, 0, -460]},
    "load": {"F_N": [0, 0, -2500]},
    "measurement": {},
    "joints": {"unknown": ["q2", "q3", "q4", "q5", "q6"], "fixed_deg": {"q1": 0}},
    "noise": {"tracker_position_mm": [4500, 2500, 1200], "along": [10, 0.4], "across": [15, 6]},
    "marker": [
        {"name": "tip", "position_mm": [0, 100, 0]},
        {"name": "arm", "position_mm": [200, 0, 300], "joint": "q3"},
    ],
    "sight": {},
}
SCENE = {
    "box": [{"name": "column", "size_mm": [400, 400, 3000], "position_mm": [2800, 1300, 1500]}],
    "cylinder": [{"name": "post", "radius_mm": 80, "height_mm": 2e3, "position_mm": [3e3, 0, 9e2]}],
    "capsule": [
        {"name": "pipe", "from_mm": [2900, 900, 0], "to_mm": [2900, 900, 2000], "radius_mm": 50}
    ],
    "plane": [{"name": "floor", "normal": [0, 0, 1], "position_mm": [0, 0, -10]}],
    "hanging": {"rope_mm": 300, "radius_mm": 150, "height_mm": 300, "swing_deg": 5},
}
STUDY = Study(**KEYS, scene=SCENE)


def sight() -> Sight:
    """What the study with a cell sees."""
    assert STUDY.sight is not None
    return STUDY.sight


def poses(count: int) -> Array:
    """Random poses (count, 6) within the limits."""
    lower, upper = STUDY.robot.limits
    return lower + (upper - lower) * np.random.default_rng(0).random((count, 6))


def test_a_second_implementation_finds_the_same_markers_hidden() -> None:
    """The golden section over points of the beam hides the same markers as distances do."""
    q = poses(800)
    seen = sight().seen(q)
    plain = setting_to_dict(STUDY, STUDY.space, STUDY.main_criterion)
    setting = Setting.from_dict(json.loads(json.dumps(plain)))
    assert setting.sight is not None
    np.testing.assert_array_equal(setting.sight.seen(setting.chain, q), seen)
    assert (seen.mean(axis=0) > 0.05).all()
    names = {why.body for row in sight().hidden(q) for why in row if why is not None}
    assert {"column", "post", "pipe", "floor", "forearm"} <= names


def test_a_beam_has_the_slope_of_its_distance() -> None:
    """Derivatives of the distance to the nearest body are differences, but at kinks."""
    q = poses(200)
    constraint = AllSeen(sight())
    frames = STUDY.robot.frames(q)
    rows = [i for i, name in enumerate(constraint.labels(STUDY.robot)) if "beam" in name]
    assert len(rows) == 2
    found = constraint.gradient(frames)[rows]
    h = 1e-6
    off = np.zeros(found.shape)
    for j, step in enumerate(h * np.eye(6)):
        up, down = (constraint.slack(STUDY.robot.frames(q + s * step))[rows] for s in (1, -1))
        off[:, j] = np.abs(found[:, j] - (up - down) / (2 * h))
    assert np.abs(found).max() > 0.5
    assert np.quantile(off.max(axis=1), 0.98) < 1e-6


def test_a_beam_touches_nothing_where_its_slack_is_positive() -> None:
    """The smooth slack vanishes where a lone body touches, and before two of them do."""
    frames = STUDY.robot.frames(poses(4000), sight().bodies_in_beams)
    look, every = sight()._look(frames), np.ones((2, 4000), dtype=bool)
    slack, least = look.smooth(every, slopes=False)[0], look.nearest(every)[0]
    assert (least[slack >= 0] >= 0).all()
    alone = np.bincount(look.found.beam, minlength=least.size).reshape(least.shape) == 1
    edge = alone & (np.abs(least) < 1e-3)
    assert edge.any()
    assert np.abs(slack - least)[edge].max() < 1e-5
    np.testing.assert_array_equal(slack[least == least.max()], least.max())


def test_the_last_part_of_a_beam_is_not_hidden_by_the_marker_s_own_body() -> None:
    """A marker inside the capsule of its own body is read if that much of the beam is left out."""
    assert STUDY.cell is not None
    q = poses(100)
    deep = replace(sight(), beams=replace(sight().beams, own=0.0))  # type: ignore[type-var]
    far = replace(sight(), beams=replace(sight().beams, own=9.0))  # type: ignore[type-var]
    own = {body.name for body in STUDY.cell.bodies if body.carrier == 2}
    hiding = [{str(why.body) for row in one.hidden(q) if (why := row[1])} for one in (deep, far)]
    assert own & hiding[0]
    assert not own & hiding[1]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            {"scene": {"box": [WALL | {"position_mm": [4500, 2500, 1200]}]}},
            "noise.tracker_position_mm: the tracker stands 50 mm inside 'wall'",
        ),
        (
            {"scene": {"box": [WALL]}, "sight": {"camera": [{"position_mm": WALL["position_mm"]}]}},
            "sight.camera: the camera 1 stands inside 'wall'",
        ),
        (
            {"scene": None, "sight": {"own_body_mm": 50}},
            "sight.own_body_mm: goes with [scene], which has what hides markers",
        ),
        (
            {"scene": {"box": [WALL | {"size_mm": [100, 9000, 9000]}]}},
            "marker: no pose shows 'tip' to the tracker; most often it is so: hidden by wall",
        ),
    ],
)
def test_a_tracker_that_sees_nothing_is_said_in_one_line(
    keys: dict[str, object], message: str
) -> None:
    """A tracker inside a wall or behind it, and what is said of beams without a cell."""
    with pytest.raises(UserError) as error:
        Study(**(KEYS | keys))  # type: ignore[arg-type]
    assert message in str(error.value)


def test_a_check_says_what_is_hidden() -> None:
    """Each pose lists the markers that are hidden with their reasons, in text and JSON."""
    assert STUDY.cell is not None
    q = poses(6)
    found = PlanCheck(STUDY.cell, q, seen=Seen(sight(), q))
    names = ("tip", "arm")
    for row, own in zip(found.to_dict()["poses"], sight().hidden(q), strict=True):
        expected = {n: str(why) for n, why in zip(names, own, strict=True) if why is not None}
        assert row["hidden"] == expected
        assert row["read"] == [name for name in names if name not in expected]
    assert any("hidden by" in line for line in plan_check_text(found).splitlines())
    assert "hidden" not in PlanCheck(STUDY.cell, q).to_dict()["poses"][0]


def test_no_lower_bound_is_above_the_distance_of_a_beam() -> None:
    """Of random segments and turned shapes; of nearly all that are apart it is positive."""
    rng = np.random.default_rng(3)
    turned = np.linalg.qr(rng.normal(size=(6, 3, 3)))[0]
    poses = np.tile(np.eye(4), (6, 1, 1))
    poses[:, :3, :3] = turned * np.linalg.det(turned)[:, None, None]
    poses[:, :3, 3] = rng.normal(size=(6, 3))
    start, end = 3 * rng.normal(size=(2, 3, 2000))
    boxes = [Box(pose, rng.uniform(0.1, 1.0, 3)) for pose in poses]
    cylinders = [Cylinder(pose, *rng.uniform(0.1, 1.0, 2)) for pose in poses]
    standing = _Standing.of(boxes, cylinders)
    bound = standing.below(start, end)
    which, beam = (one.ravel() for one in np.indices(bound.shape))
    beyond = np.full(which.shape, np.inf)
    found = standing.nearest(which, start[:, beam], end[:, beam], beyond).distance
    assert (bound.ravel() <= found + 1e-9).all()
    for part, least in ((which < len(boxes), 0.999), (which >= len(boxes), 0.97)):
        apart = part & (found > 0.01)
        assert (bound.ravel()[apart] > 0).mean() > least


def test_a_beam_is_looked_at_once_in_each_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slacks, their slopes and what is read of the same frames share the distances of beams."""
    looked: list[int] = []
    passing = Beams.passing

    def counted(*given: Any) -> Any:
        looked.append(int(given[-1].sum()))
        return passing(*given)

    monkeypatch.setattr(Beams, "passing", counted)
    frames = STUDY.robot.frames(poses(50), sight().bodies)
    half = np.arange(100).reshape(2, 50) % 2 == 0
    AllSeen(sight(), half).slack(frames)
    constraint = AllSeen(sight())
    constraint.slack(frames)
    constraint.gradient(frames)
    sight().seen_in(frames)
    assert looked == [50, 50]

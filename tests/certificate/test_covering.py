"""Coverings of all poses: true ones are confirmed without the prover, false ones are refused."""

import copy
import json
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from three_joints import THREE

import criteria
import edtk
import edtk.design.enclosure.cover as prover
from edtk.certificate.certificate import certificate
from edtk.certificate.coverings import coverings_to_list
from edtk.certificate.recompute.covering import Covering, largest_sensitivities
from edtk.certificate.recompute.forms import DEGREE, Form, Link
from edtk.certificate.recompute.physics import Friction
from edtk.certificate.recompute.pose_polynomials import Growth, Polynomials, require_checkable
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.recompute.tasks import EPS
from edtk.certificate.recompute.values import Multipliers
from edtk.certificate.verify_certificate import verify_certificate
from edtk.design.enclosure.boxes import Reason
from edtk.design.enclosure.cover import cover
from edtk.design.enclosure.robot_polynomials import RobotPolynomials
from edtk.study.plan_study import relax_study
from edtk.study.study import Study, load_study
from edtk.system.typing import Array

ROOT = Path(__file__).parents[2]
Content = dict[str, Any]


@pytest.fixture(scope="module")
def honest() -> Content:
    """A certificate of weights on a few poses, with a covering in two halves of each first box."""
    study = load_study(ROOT / "studies" / "kr270_milling.toml")
    content = json.loads(json.dumps(certificate(study, relax_study(study, "D", candidates=100))))
    setting = Setting.from_dict(content["setting"])
    polynomials = about(setting, content["proof"]["multipliers"])
    written = np.abs(content["proof"]["multipliers"]).max()
    Z = Multipliers.from_list(content["proof"]["multipliers"], "D", setting.p)
    limit = polynomials.sensitivity.size * 3 * written / np.abs(Z.Z).max()
    content["proof"]["continuum"] = {
        "multipliers": content["proof"]["multipliers"],
        "coverings": [of_first_boxes(polynomials, limit, "3..")],
    }
    # The weakest of true bounds.
    content["claims"]["bound_proved"] = 0.0
    for claim in verify_certificate(content).claims:
        if claim.claim == "bound_proved":
            content["claims"]["bound_proved"] = claim.recomputed
    return content  # type: ignore[no-any-return]


def about(setting: Setting, multipliers: Any) -> Polynomials:
    """Sensitivity and slacks under the study's load."""
    Z = Multipliers.from_list(multipliers, "D", setting.p)
    wrench = np.asarray(setting.load.wrench(np.ones((1, setting.load.size))))[0]
    return Polynomials.of(setting, Z, np.zeros((setting.p, setting.p)), wrench, False)


def of_first_boxes(polynomials: Polynomials, limit: float, tree: str) -> Content:
    """A covering with the same tree below each first box of a right angle at most."""
    low, high = polynomials.domain.limits
    parts = np.where(polynomials.domain.slides, 1, np.ceil((high - low) / (np.pi / 2))).astype(int)
    return {
        "limit": limit,
        "joints": list(range(len(low))),
        "low": low.tolist(),
        "high": high.tolist(),
        "motions": [],
        "parts": parts.tolist(),
        "slacks": "hru",
        "tree": tree * int(parts.prod()),
        "factors": [],
    }


def values(form: Form, polynomials: Polynomials, x: Array) -> Array:
    """Values (k,) of a polynomial at places (k, v), one function after the other."""
    found = np.broadcast_to(form.values, (len(x), *form.values.shape))
    low, high = polynomials.domain.limits
    for j, slides in enumerate(polynomials.domain.slides):
        n = found.shape[1]
        if slides:
            functions = np.vander((2 * x[:, j] - low[j] - high[j]) / (high[j] - low[j]), n, True)
        else:
            turns = np.arange(1, n // 2 + 1) * x[:, j, None]
            both = np.stack([np.cos(turns), np.sin(turns)], axis=-1).reshape(len(x), -1)
            functions = np.concatenate([np.ones((len(x), 1)), both], axis=1)
        found = np.einsum("kn,kn...->k...", functions, found)
    return found


def scara() -> Setting:
    """An arm with three parallel axes and one that slides, under a slanted force."""
    study = load_study(ROOT / "studies" / "kr270_milling.toml")
    content = certificate(study, relax_study(study, "D", candidates=50))["setting"]
    frame = np.eye(4)
    frame[:3, 3] = [0.4, 0.0, 0.1]
    turning = {"kind": "revolute", "origin": frame.tolist(), "axis": [0, 0, 1], "limits": [-2, 2.5]}
    sliding = turning | {"kind": "prismatic", "limits": [-0.3, 0.2], "axis": [0, 0.6, 0.8]}
    joints = [turning | {"name": f"q{j}"} for j in (1, 2, 3)] + [sliding | {"name": "q4"}]
    robot = content["robot"] | {"joints": json.loads(json.dumps(joints))}
    changed = {
        "robot": robot,
        "unknown": [0, 1, 3],
        "free": [0, 1, 2, 3],
        "fixed": [0.0] * 4,
        "load": {"F_N": [30.0, -20.0, 90.0]},
        "test_pose": None,
    }
    return Setting.from_dict(content | changed)


def palletiser() -> Setting:
    """An arm whose forearm and wrist turn with two drives, under a slanted force."""
    study = load_study(ROOT / "studies" / "palletiser.toml")
    content = certificate(study, relax_study(study, "D", candidates=50))["setting"]
    changed = {"load": {"F_N": [100.0, 300.0, -1200.0]}, "test_pose": None}
    return Setting.from_dict(json.loads(json.dumps(content)) | changed)


def arm_of(name: str, content: Content) -> Setting:
    """The paper's robot, or one of the others."""
    others = {"scara": scara, "palletiser": palletiser}
    return others[name]() if name in others else kr270(content)


def kr270(content: Content) -> Setting:
    """The paper's robot."""
    return Setting.from_dict(content["setting"])


def margin_of(setting: Setting) -> float:
    """How far planned poses keep away from the limits of coupled joints [rad]."""
    margins = setting.workspace.margin
    return float(margins[0]) if len(margins) else 0.0


def largest(form: Form, polynomials: Polynomials, low: Array, high: Array) -> float:
    """The largest coefficient of a polynomial on one box."""
    v = len(low)
    one = np.zeros((1, v), dtype=int)
    covering = Covering(
        limit=0.0,
        joints=list(range(v)),
        links=[],
        motions=[],
        low=low,
        high=high,
        parts=np.ones(v, dtype=int),
        depth=one,
        place=one,
        reasons=np.array(["."]),
        factors=np.zeros((1, 0)),
        slacks="",
    )
    found = covering._largest(polynomials.domain, [form], np.zeros(1, dtype=int), np.ones((1, 1)))
    return float(found[0])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_sum_of_angles_is_another_variable(sign: int) -> None:
    """A polynomial of two angles and a length has the same values in one of both and their sum."""
    rng = np.random.default_rng(3)
    form = Form(rng.normal(size=(5, 3, 7)), 0.0)
    t = rng.uniform(-3, 3, size=(50, 3))
    s = t.copy()
    s[:, 0] += sign * t[:, 2]

    def at(form: Form, t: Array) -> Array:
        found = np.broadcast_to(form.values, (len(t), *form.values.shape))
        for j, slides in enumerate((False, True, False)):
            degree = found.shape[1] // 2
            turns = t[:, j, None] * np.arange(1, degree + 1)
            both = np.stack([np.cos(turns), np.sin(turns)], axis=-1).reshape(len(t), -1)
            angle = np.concatenate([np.ones((len(t), 1)), both], axis=1)
            own = np.vander(t[:, j], found.shape[1], True) if slides else angle
            found = np.einsum("kn,kn...->k...", own, found)
        return np.asarray(found)

    moved = Link(2, 0, sign).of(form)
    assert moved.values.shape == (5, 3, 11)
    assert np.abs(at(moved, s) - at(form, t)).max() < 1e-13 * form.size
    assert 0 < moved.error < 1e-13 * form.size


@pytest.mark.parametrize("arm", ["kr270", "scara", "palletiser"])
def test_polynomials_are_what_poses_say(arm: str, honest: Content) -> None:
    """Sensitivity and slacks are those of the poses, within the rounding that is counted."""
    setting = arm_of(arm, honest)
    p = setting.p
    rng = np.random.default_rng(3)
    R = rng.normal(size=(p, p)) / np.arange(1, p + 1)
    Z = Multipliers.of((R @ R.T)[None], False)
    wrench = setting.load.wrench(np.zeros((1, 0)))[0]
    found = Polynomials.of(setting, Z, np.eye(p), wrench, False)
    x = rng.uniform(*found.domain.limits, (300, len(found.domain.joints)))
    q = np.tile(setting.fixed, (300, 1))
    q[:, found.domain.joints] = x
    A = setting.whitened_rows(q, np.broadcast_to(wrench, (300, 9)))
    own = np.einsum("kra,ab,krb->k", A, Z.Z[0], A) + np.trace(Z.Z[0])
    away = np.abs(values(found.sensitivity, found, x) - own).max()
    assert away <= found.sensitivity.error
    assert found.sensitivity.error <= 1e-7 * np.abs(own).max()
    sizes = np.array(found.sensitivity.values.shape)
    assert (sizes <= 2 * DEGREE * found.domain.degrees + 1).all()
    assert max(found.domain.degrees) == (2 if arm == "palletiser" else 1)
    point, axis = setting.chain.tool_point_and_axis(q)
    slacks = {
        "h": point[:, 2] - (setting.workspace.height or 0.0),
        "r": (point[:, :2] ** 2).sum(axis=1) - (setting.workspace.radius or 0.0) ** 2,
        "u": np.sin(setting.workspace.tilt or 0.0) - axis[:, 2],
        "d": np.sin(setting.workspace.tilt or 0.0) + axis[:, 2],
    }
    (low,), (high,) = setting.chain.coupled[1] if arm == "palletiser" else ([0.0], [0.0])
    own = x[:, 2] - x[:, 1]
    slacks["A"] = np.cos(own - (low + high) / 2) - np.cos((high - low) / 2 - margin_of(setting))
    assert ("A" in found.slacks) == (arm == "palletiser")
    for letter, form in found.slacks.items():
        assert np.abs(values(form, found, x) - slacks[letter]).max() <= form.error, letter


@pytest.mark.parametrize("arm", ["kr270", "scara", "palletiser"])
def test_no_value_in_a_box_is_above_the_largest_coefficient(arm: str, honest: Content) -> None:
    """Theorem 2: and in small boxes the excess is small, by the square of the box."""
    setting = arm_of(arm, honest)
    found = about(setting, np.eye(setting.p)[None].tolist())
    rng = np.random.default_rng(8)
    low, high = found.domain.limits
    excess = []
    for size in (1.0, 0.25):
        middle = low + (high - low) * rng.uniform(0.4, 0.6, len(low))
        half = np.minimum(0.4, (high - low) / 4) * size
        top = largest(found.sensitivity, found, middle - half, middle + half)
        ends = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * len(low)), axis=-1).reshape(-1, len(low))
        x = middle + half * np.concatenate([ends, rng.uniform(-1, 1, (500, len(low)))])
        best = values(found.sensitivity, found, x).max()
        assert best <= top
        excess.append(top - best)
    assert excess[1] < excess[0] / 4


def failure(content: Content) -> str:
    """Why the proved bound does not hold; empty if it does."""
    claims = {claim.claim: claim for claim in verify_certificate(content).claims}
    return claims["bound_proved"].reason


def changed(content: Content, **changes: Any) -> Content:
    """A certificate whose first covering says something else."""
    found = copy.deepcopy(content)
    found["proof"]["continuum"]["coverings"][0].update(changes)
    return found


@pytest.mark.slow
def test_a_true_covering_is_confirmed(honest: Content) -> None:
    """All claims hold, and the words say that the bound is proved over all poses."""
    found = verify_certificate(honest)
    assert found.valid, found.claims
    assert "proved over all poses" in found.proved


@pytest.mark.slow
def test_coverings_that_an_enemy_has_changed(honest: Content) -> None:
    """A leaf less or more, a lower limit, false reasons, limits or motions are refused."""
    given = honest["proof"]["continuum"]["coverings"][0]
    tree = given["tree"]
    whole = [0] * 5
    mirror = {"mirrors": [0, 0, 0, 0, 1], "turns": whole, "joint": 4, "low": 0.0, "high": 3.1}
    low, high = given["low"], given["high"]
    refused = {
        "a leaf is missing": {"tree": tree[:-1]},
        "after its last leaf": {"tree": tree + "."},
        "boxes are open": {"limit": given["limit"] * 1e-3},
        "are open": {"tree": "h" + tree[3:]},
        "do not cover the limits": {"low": [low[0] + 1e-3, *low[1:]]},
        "does not take what is left": {"motions": [mirror | {"high": 2.0}]},
        "leaves out a joint": {
            "joints": [0, 1, 2, 3],
            "low": low[:4],
            "high": high[:4],
            "parts": given["parts"][:4],
            "tree": "." * int(np.prod(given["parts"][:4])),
        },
        "factors from zero": {"tree": "+" + tree[3:], "factors": [[-1.0, 0.0, 0.0]]},
        "expected digits": {"tree": "?" + tree[3:]},
        "unknown key": {"wider": 1},
    }
    for reason, changes in refused.items():
        assert reason in failure(changed(honest, **changes)), reason
    lowered = copy.deepcopy(honest)
    lowered["claims"]["bound_proved"] *= 1 + 1e-6
    assert failure(lowered) == "the recomputed number differs"
    none = copy.deepcopy(honest)
    none["proof"]["continuum"]["coverings"] = []
    assert "expected one for each multiplier and load" in failure(none)
    del none["proof"]["continuum"]
    assert "no covering" in failure(none)


def test_factors_that_overflow_close_no_box(tmp_path: Path) -> None:
    """Sums with a huge factor are no numbers, which are not at most zero."""
    edtk.relax(Study(**THREE), "D", prove=0.2, certificate=tmp_path / "proof.json")
    content = json.loads((tmp_path / "proof.json").read_text(encoding="utf-8"))
    assert not failure(content)
    given = content["proof"]["continuum"]["coverings"][0]
    boxes = int(np.prod(given["parts"]))
    lower = {"limit": 0.1 * given["limit"], "tree": "+" * boxes, "slacks": "h"}
    for factor in (1.0, 1e300, 1.7e308):
        enemy = changed(content, **lower, factors=[[factor]] * boxes)
        assert "boxes are open" in failure(enemy), factor


def test_friction_is_no_polynomial(honest: Content) -> None:
    """A covering of a setting with friction is refused by name."""
    setting = kr270(honest)
    ones = np.ones(len(setting.unknown))
    with pytest.raises(ValueError, match="not checked here with friction"):
        require_checkable(replace(setting, friction=Friction(ones, ones)))


def test_a_motion_counts_what_it_changes(honest: Content) -> None:
    """A mirror that changes the sensitivity leaves no box closed at a limit near its maximum."""
    setting = kr270(honest)
    found = about(setting, honest["proof"]["multipliers"])
    limit = float(np.abs(found.sensitivity.values).sum())
    half = of_first_boxes(found, limit * 3, ".")
    motion = {"mirrors": [0, 0, 1, 0, 0], "turns": [0] * 5, "joint": 2, "low": 0.0, "high": np.pi}
    cut = copy.deepcopy(half) | {"motions": [motion]}
    low, high = -np.pi, np.pi
    cut["low"][2], cut["high"][2] = low, high
    cut["tree"] = "." * int(np.prod(cut["parts"]))
    Z = Multipliers.from_list(honest["proof"]["multipliers"], "D", setting.p)
    none = np.zeros((setting.p, setting.p))
    straight = largest_sensitivities([half], setting, Z, np.ones(1), none, False)
    mirrored = largest_sensitivities([cut], setting, Z, np.ones(1), none, False)
    assert straight[0] == pytest.approx(limit * 3, rel=1e-6)
    assert mirrored[0] > straight[0]


@pytest.mark.slow
def test_what_the_prover_covers_is_confirmed(honest: Content) -> None:
    """Boxes of the search for a bound, its symmetries and its factors hold in the second way."""
    study = load_study(ROOT / "studies" / "kr270_milling.toml").designed
    Z = np.array(honest["proof"]["multipliers"])
    robot = RobotPolynomials(study.space)
    covering = cover(robot.enclosed(Z[0]), 0.1)
    content = copy.deepcopy(honest)
    content["proof"]["continuum"]["coverings"] = coverings_to_list(robot, covering)
    claims = {claim.claim: claim for claim in verify_certificate(content).claims}
    assert claims["bound_proved"].reason == "the recomputed number differs"
    told = criteria.get("D")().lower_bound(Z, np.array([covering.upper]), np.eye(len(Z[0])))
    assert claims["bound_proved"].recomputed == pytest.approx(1 / told, rel=1e-7)
    given = content["proof"]["continuum"]["coverings"][0]
    assert len(given["motions"]) == 2
    assert {".", "+"} <= set(given["tree"])
    # Limits, slacks and boxes are those of sums: other sums, or none, cover or close less.
    (link,) = given["links"]
    for links in ([], [[*link[:2], -link[2]]], [[1, 2, 1]], [link, link]):
        assert failure(changed(content, links=links)), links
    for links in ([[0, 0, 1]], [[0, 1, 0]], [[0, 9, 1]], [[0, 1]]):
        assert "links[0]" in failure(changed(content, links=links)), links
    # Closed by its factors alone: without them the box stays open.
    given["factors"] = np.zeros_like(given["factors"]).tolist()
    assert "boxes are open" in failure(content)


def test_the_allowance_of_sensitivities_per_trace_is_in_their_unit(honest: Content) -> None:
    """They are ratios; rounding of their numerators, which are huge, counts beside denominators."""
    setting = kr270(honest)
    Z = Multipliers.of(np.eye(setting.p)[None], True)
    wrench = setting.load.wrench(np.zeros((1, 0)))[0]
    found = Polynomials.of(setting, Z, np.zeros((setting.p, setting.p)), wrench, True)
    assert 0 < found.blur(1.0) < 1e-7
    # All of these ratios are one half, as multipliers are read at that size.
    assert np.abs(found.tested(0.5).values).max() <= found.tested(0.5).error


@pytest.mark.parametrize("asked", [0, 2, 12])
def test_boxes_that_an_early_end_leaves_open_are_certified(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: int
) -> None:
    """They have the bound of a box around them, with its factors: the file is whole, and valid."""
    path = tmp_path / "certificate.json"
    times = count()
    monkeypatch.setattr(prover, "out_of_time", lambda: next(times) >= asked)
    found = edtk.relax(Study(**THREE), "D", prove=1e-6, certificate=path)
    assert any((one.leaves[0].reason == Reason.OPEN).any() for one in found.coverings)
    verdict = edtk.verify(path)
    assert "bound_proved" in {claim.claim for claim in verdict.claims}
    assert verdict.valid


def test_entries_of_an_indefinite_multiplier_are_bounded_in_units_of_each_parameter() -> None:
    """``|Z_ab| <= s_a s_b`` with s from Z+ and Z-; of a diagonal one s are the roots of its sizes.

    With the norm of Z for all parameters, roundings of large columns of little weight would count
    as those of the others: a hundred thousand times more here.
    """
    rng = np.random.default_rng(4)
    units = np.array([1e-5, 1.0, 1e-2, 3.0])
    R = rng.normal(size=(20, 4, 4))
    Z = units[:, None] * (R + np.swapaxes(R, 1, 2)) * units
    scale = Multipliers.of(Z, True).scale
    read = Multipliers.of(Z, True).Z
    assert (np.abs(read) <= scale[:, :, None] * scale[:, None] * (1 + 1e-14)).all()
    sizes = np.array([0.5, -1e-10, 1e-6, -0.25])
    of_diagonal = Multipliers.of(np.diag(sizes)[None], True).scale[0]
    assert np.allclose(of_diagonal, np.sqrt(np.abs(sizes)), rtol=1e-4, atol=0)


def test_bounds_by_indefinite_multipliers_are_confirmed(tmp_path: Path) -> None:
    """A true bound holds; one that is better by a millionth does not, whatever its limits say."""
    path = tmp_path / "proof.json"
    edtk.relax(Study(**THREE), "O4", prove=0.3, certificate=path)
    content = json.loads(path.read_text(encoding="utf-8"))
    assert not failure(content)
    content["claims"]["bound_proved"] *= 1 - 1e-6
    assert failure(content) == "the recomputed number differs"
    for one in content["proof"]["continuum"]["coverings"]:
        one["limit"] *= 1 - 4e-6
    assert "boxes are open" in failure(content)


TRACKERS = {
    "alike": {"tracker_position_mm": [1400, 600, 600], "along": [20, 10], "across": [20, 10]},
    "less along": {"tracker_position_mm": [1400, 600, 600], "along": [4, 1], "across": [20, 10]},
    "joints scatter": {
        "tracker_position_mm": [1400, 600, 600],
        "along": [20, 10],
        "across": [20, 10],
        "repeatability_deg": 1e-4,
    },
}


@pytest.mark.parametrize("noise", TRACKERS)
def test_bounds_under_a_tracker_are_confirmed(noise: str, tmp_path: Path) -> None:
    """A true bound holds; with a leaf less, a lower limit, or another tracker it does not."""
    path = tmp_path / "proof.json"
    study = Study(**THREE | {"measurement": {"sigma_mm": 0.01}, "noise": TRACKERS[noise]})
    found = edtk.relax(study, "D", prove=0.2, certificate=path)
    assert found.continuum_bound.gap <= 0.2
    content = json.loads(path.read_text(encoding="utf-8"))
    assert not failure(content)
    given = content["proof"]["continuum"]["coverings"][0]
    assert "boxes are open" in failure(changed(content, limit=given["limit"] / 2))
    assert "a leaf is missing" in failure(changed(content, tree=given["tree"][:-1]))
    better = copy.deepcopy(content)
    better["claims"]["bound_proved"] *= 1 + 1e-6
    assert failure(better) == "the recomputed number differs"
    for key, value in (
        ("across", [1e-5, 1e-5]),
        ("along", [1e-6, 1e-6]),
        ("position", [0.7, 0.3, 0.6]),
        (None, None),
    ):
        enemy = copy.deepcopy(content)
        if key is None:
            enemy["setting"]["noise"]["tracker"] = None
        else:
            enemy["setting"]["noise"]["tracker"][key] = value
        assert failure(enemy), key


def test_no_rounding_makes_a_factor_less() -> None:
    """That of Q is no less than k(s_0), and that of N no less than the variances' ratio."""
    growth = Growth(1e-10, 2, np.array([1e-6, 2e-6]), np.array([8e-6, 5e-6]), 0.0)
    s = np.array([np.linspace(1.0, 9.0, 50), np.linspace(1.5, 9.5, 50)])
    of_N, _, of_Q, _ = growth.factors(2.0, s, np.ones(50), near=False).T
    assert (of_N == 1).all()
    assert (of_Q >= growth.inline(s[0]) * (1 + 40 * EPS)).all()
    near = growth.factors(2.0, s, np.ones(50), near=True)[:, 0]
    assert (near >= growth.ratio(s[1], s[0]) * (1 + 40 * EPS)).all()


def test_errors_that_vanish_at_a_tracker_are_confirmed(tmp_path: Path) -> None:
    """Out of reach they do not vanish, though the wide boxes do not know; within reach they do."""
    path = tmp_path / "proof.json"
    noise = {"tracker_position_mm": [2600, 600, 600], "along": [0, 6], "across": [10, 6]}
    study = Study(**THREE | {"measurement": {}, "noise": noise})
    assert edtk.relax(study, "D", prove=0.2, certificate=path).continuum_bound.gap <= 0.2
    content = json.loads(path.read_text(encoding="utf-8"))
    assert not failure(content)
    content["setting"]["noise"]["tracker"]["position"] = [0.7, 0.3, 0.6]
    assert "with such a tracker" in failure(content)


@pytest.mark.parametrize("noise", ["alike", "less along"])
def test_boxes_say_what_a_tracker_tells(noise: str) -> None:
    """The check's own polynomials are no lower than sensitivities anywhere in a box."""
    study = Study(**THREE | {"measurement": {"sigma_mm": 0.01}, "noise": TRACKERS[noise]})
    content = json.loads(json.dumps(certificate(study, relax_study(study, "D", candidates=50))))
    setting = Setting.from_dict(content["setting"])
    found = about(setting, content["proof"]["multipliers"])
    Z = Multipliers.from_list(content["proof"]["multipliers"], "D", setting.p)
    assert found.beam is not None
    indefinite = Multipliers.of(Z.Z, True)
    with pytest.raises(ValueError, match="only bounds what a pose tells from above"):
        Polynomials.of(setting, indefinite, np.zeros((3, 3)), np.zeros(9), False)
    rng = np.random.default_rng(2)
    middle = rng.uniform(*found.domain.limits)
    q = np.tile(setting.fixed, (400, 1))
    for half, loose in ((0.3, 0.5), (0.02, 0.01)):
        x = middle + rng.uniform(-half, half, (400, 3))
        q[:, found.domain.joints] = x
        wrench = np.broadcast_to(setting.load.wrench(np.zeros((1, 0)))[0], (400, 9))
        own = Z.sensitivities(setting.whitened_rows(q, wrench), np.zeros((3, 3)), False)[0].max()
        low, high = middle - half, middle + half
        most = closed_at(found, low, high)
        assert own <= most <= own * (1 + loose)


def closed_at(found: Polynomials, low: Array, high: Array) -> float:
    """The least limit to which a box is closed."""
    v = len(low)
    one = np.zeros((1, v), dtype=int)
    box = Covering(
        *(0.0, list(range(v)), [], [], low, high, np.ones(v, dtype=int), one, one),
        *(np.array(["."]), np.zeros((1, 0)), ""),
    )
    least, most = 0.0, 1e12
    for _ in range(100):
        limit = (least + most) / 2
        least, most = (limit, most) if box.open_leaves(found, limit) else (least, limit)
    return most


GEOMETRY = {key: value for key, value in THREE.items() if key not in ("load", "joints")} | {
    "parameters": {"geometry": "all"}
}
SPRINGY = GEOMETRY | {
    "parameters": {"geometry": "all", "compliance": ["q2", "q3"]},
    "load": THREE["load"],
}


@pytest.mark.parametrize("study", [GEOMETRY, SPRINGY], ids=["geometry", "springs too"])
def test_bounds_of_geometry_are_confirmed(study: Content, tmp_path: Path) -> None:
    """A true bound holds; with a leaf less, a lower limit, or another arm it does not."""
    path = tmp_path / "proof.json"
    found = edtk.relax(Study(**study), "D", prove=0.3, certificate=path)
    assert found.continuum_bound.gap <= 0.3
    content = json.loads(path.read_text(encoding="utf-8"))
    assert not failure(content)
    given = content["proof"]["continuum"]["coverings"]
    for one in given:
        one["limit"] /= 2
    assert "boxes are open" in failure(content)
    for one in given:
        one["limit"] *= 2
    assert "a leaf is missing" in failure(changed(content, tree=given[0]["tree"][:-1]))
    better = copy.deepcopy(content)
    better["claims"]["bound_proved"] *= 1 + 1e-6
    assert failure(better) == "the recomputed number differs"
    enemy = copy.deepcopy(content)
    enemy["setting"]["robot"]["joints"][2]["origin"][0][3] *= 1.3
    assert failure(enemy)


def test_polynomials_of_geometry_are_what_poses_say(tmp_path: Path) -> None:
    """Errors of frames and springs: values are within the rounding that is counted."""
    path = tmp_path / "proof.json"
    edtk.relax(Study(**SPRINGY), "D", prove=0.9, certificate=path)
    content = json.loads(path.read_text(encoding="utf-8"))
    setting = Setting.from_dict(content["setting"])
    Z = Multipliers.from_list(content["proof"]["multipliers"], "D", setting.p)
    assert setting.load.listed is not None
    for wrench in setting.load.listed:
        found = Polynomials.of(setting, Z, np.zeros((setting.p, setting.p)), wrench, False)
        rng = np.random.default_rng(4)
        q = rng.uniform(*found.domain.limits, (200, 3))
        A = setting.whitened_rows(q, np.broadcast_to(wrench, (200, 9)))
        own = np.einsum("kra,ab,krb->k", A, Z.Z[0], A)
        away = np.abs(values(found.sensitivity, found, q) - own).max()
        assert away <= found.sensitivity.error <= 1e-6 * own.max()

"""What proves the numbers of a relaxation or of an exact plan, as plain data."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

import criteria
from criteria.linalg.inverse import ROUNDING, unit_spectrum
from criteria.worst_task_accuracy import WorstTaskAccuracy
from edtk.cell.beams import Beams
from edtk.cell.shapes import Box, Capsule, Plane, Shape
from edtk.cell.sight import Eye, Reflector, Sight
from edtk.certificate.case import ON_CANDIDATES
from edtk.certificate.coverings import coverings_to_list
from edtk.certificate.problem_proofs import tree_to_dict
from edtk.certificate.recompute.pose_polynomials import require_checkable
from edtk.certificate.recompute.setting import Setting
from edtk.design.bound import BoundKind
from edtk.design.design_space import DesignSpace
from edtk.design.enclosure.prove_continuum import ProvedPlan
from edtk.design.enclosure.robot_polynomials import polynomials_of
from edtk.design.exact.exact_plan import ExactPlan, OnCandidates
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.friction import Friction
from edtk.measure.instruments.distance import Distance
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.measure.instruments.sensor import Sensor
from edtk.measure.task import Task
from edtk.robots.compensator import GivingWay, Pull
from edtk.robots.constraints.excluded import Excluded
from edtk.robots.frames import BodyPoint
from edtk.robots.robot import Robot
from edtk.robots.weights import DeadWeights
from edtk.study.study import Study
from edtk.system.errors import UserError, note
from edtk.system.parsing import json_text
from edtk.system.typing import Array
from edtk.version import __version__

NONE: Mapping[tuple[int, ...], RelaxedPlan] = MappingProxyType({})


def certificate(
    study: Study,
    found: RelaxedPlan | ExactPlan,
    setting: dict[str, Any] | None = None,
    day: dict[str, Any] | None = None,
    proofs: Mapping[tuple[int, ...], RelaxedPlan] = NONE,
) -> dict[str, Any]:
    """Collect all that `verify_certificate` needs: setting, experiments, multipliers and claims.

    The content stands alone: robot, load, noise and constraints are part of it, in SI units and
    radians, but for the study's own keys, which name their units.

    Args:
        study: The study that was answered.
        found: A relaxation, or an exact plan of this study.
        setting: Robot, load, noise and constraints as plain data; defaults to `setting_to_dict`,
            which knows studies of compliances alone.
        day: What visits and load changes of a plan cost, and its budget; None without one.
        proofs: The relaxations of all sets of loads that the budget pays for.

    Returns:
        Plain data for JSON.
    """
    # Those who check a certificate know no cell.
    found = found.certified
    relaxed = found.relaxed if isinstance(found, ExactPlan) else found
    if setting is None:
        setting = setting_to_dict(study, relaxed.space, relaxed.criterion.name)
    continuum = _continuum(relaxed, setting)
    if isinstance(found, ExactPlan):
        answer = {
            "kind": "plan",
            "claims": _plan_claims(found, bool(continuum)),
            "experiments": _repeated(found.plan),
            "kept": [] if found.kept is None else _repeated(found.kept),
        }
        if day is not None:
            answer["day"] = day
        elif found.on_candidates is not None:
            answer[ON_CANDIDATES] = _exact(found.on_candidates)
    else:
        answer = {
            "kind": "relaxation",
            "claims": _relaxation_claims(found, bool(continuum)),
            "experiments": _weighted(found),
            "kept": [],
        }
    return {
        "edtk": __version__,
        "title": study.specification.title,
        "study_sha256": study.digest,
        "criterion": relaxed.criterion.name,
        **answer,
        "proof": _proof(relaxed) | continuum if day is None else _proofs(proofs),
        "setting": setting,
        **_sharing(setting, found),
    }


def is_certifiable(name: str) -> bool:
    """Whether certificates of poses can be about a criterion: it needs no parameters."""
    return not criteria.get(name).needs_parameters


def require_certifiable(study: Study, name: str | None, path: Path | str | None) -> None:
    """Check, before a long search, that its certificate can be written.

    Args:
        study: The study.
        name: Name of the criterion; None for the one that the study is about.
        path: The file of the certificate; None where none is asked for.

    Raises:
        UserError: No certificate of poses tells the parameters of the criterion.
    """
    name = study.main_criterion if name is None else name
    if path is not None and name in criteria.families():
        raise UserError(
            f"criterion {name!r} has no certificate of poses, as it has parameters; leave the "
            "certificate out",
            where=study.where,
        )


def _sharing(setting: Mapping[str, Any], found: RelaxedPlan | ExactPlan) -> dict[str, int]:
    """How many experiments share the study's prior, which weights do not tell."""
    if "prior" not in setting or isinstance(found, ExactPlan):
        return {}
    return {"sharing": found.space.sharing}


def certificate_text(
    study: Study,
    found: RelaxedPlan | ExactPlan,
    setting: dict[str, Any] | None = None,
    day: dict[str, Any] | None = None,
    proofs: Mapping[tuple[int, ...], RelaxedPlan] = NONE,
) -> str:
    """The text of the certificate file of a result, see `certificate`."""
    return json_text(certificate(study, found, setting, day, proofs), indent=1) + "\n"


def _proofs(proofs: Mapping[tuple[int, ...], RelaxedPlan]) -> list[dict[str, Any]]:
    """A proof for each set of loads."""
    return [{"loads": list(loads), **_proof(one.certified)} for loads, one in proofs.items()]


def _proof(relaxed: RelaxedPlan) -> dict[str, Any]:
    """Multipliers, and the experiments over which their largest sensitivities are taken.

    To a multiplier of rho_max belong weights of the tasks, see `WorstTaskAccuracy.dual_weights`.
    """
    searched = relaxed.searched_sensitivities
    criterion = relaxed.criterion
    weights = {}
    if isinstance(criterion, WorstTaskAccuracy):
        M = relaxed.information
        weights["task_weights"] = [
            criterion.dual_weights(Z, M).tolist() for Z in relaxed.multipliers
        ]
    return {
        "candidates": relaxed.candidates,
        "seed": list(relaxed.source.seeds),
        "sampling": relaxed.source.sampling,
        "multipliers": relaxed.multipliers.tolist(),
        **weights,
        "support": relaxed.x.tolist(),
        "searched": [] if searched is None else searched.x.tolist(),
    }


def _exact(one: OnCandidates) -> dict[str, Any]:
    """The proof about all plans of whole experiments on candidates, which the seed tells."""
    chosen = np.flatnonzero(one.counts)
    return {
        "candidates": one.candidates,
        "plan": {"candidate": chosen.tolist(), "count": one.counts[chosen].tolist()},
        "value": one.value,
        "bound_exact": one.bound.value,
        "proved_exact": one.proved,
        "tree": tree_to_dict(one.tree),
    }


def _continuum(relaxed: RelaxedPlan, setting: dict[str, Any]) -> dict[str, Any]:
    """Multipliers and boxes that prove the bound over all poses: one key.

    There is none without a proof, or for a setting whose boxes `edtk verify` cannot check.
    """
    if not isinstance(relaxed, ProvedPlan):
        return {}
    robot = polynomials_of(relaxed.space)
    try:
        require_checkable(Setting.from_dict(setting))
        coverings = [coverings_to_list(robot, one) for one in relaxed.coverings]
    except ValueError as error:
        note(f"the certificate has no bound over all poses: {error}", setting["robot"]["name"])
        return {}
    found: dict[str, Any] = {"multipliers": relaxed.continuum_multipliers.tolist()}
    criterion = relaxed.criterion
    if isinstance(criterion, WorstTaskAccuracy):
        M = relaxed.information
        found["task_weights"] = [
            criterion.dual_weights(Z, M).tolist() for Z in relaxed.continuum_multipliers
        ]
    return {"continuum": found | {"coverings": [one for each in coverings for one in each]}}


def _relaxation_claims(found: RelaxedPlan, covered: bool) -> dict[str, float]:
    """Value, bounds and proved gap; a bound that says nothing is no claim."""
    claims = {"value": found.value, "bound": found.bound, "gap": found.gap}
    if found.searched_bound is not None:
        claims["bound_searched"] = found.searched_bound.value
    if isinstance(found, ProvedPlan) and covered:
        claims["bound_proved"] = found.continuum_bound.value
    return {name: float(number) for name, number in claims.items() if np.isfinite(number)}


def _plan_claims(found: ExactPlan, covered: bool) -> dict[str, float]:
    """Value, bound of its kind, and the efficiency beside a bound over all poses.

    A plan's poses need not be among the candidates: beside a bound over these alone, its efficiency
    says as much about them as about the plan.
    """
    claims = {"value": found.value, "bound": found.bound}
    bound = found.lower_bound
    searched = found.relaxed.searched_bound
    if bound.kind is BoundKind.PROVED and not covered and searched is not None:
        bound = searched.scaled(found.plan.experiments)
    names = {BoundKind.SEARCHED: "bound_searched", BoundKind.PROVED: "bound_proved"}
    if bound.kind in names:
        claims = {
            "value": found.value,
            names[bound.kind]: bound.value,
            "efficiency": bound.efficiency(found.cost),
        }
    return {name: float(number) for name, number in claims.items() if np.isfinite(number)}


def _weighted(found: RelaxedPlan) -> list[dict[str, Any]]:
    """Experiments with their weights, in the design's own order."""
    plan = found.space.plan(found.x, np.ones(len(found.x), dtype=int))
    return [
        {"q": q.tolist(), "wrench": wrench.tolist(), "weight": float(weight)}
        for q, wrench, weight in zip(plan.q, plan.wrench, found.weights, strict=True)
    ]


def _repeated(plan: Plan) -> list[dict[str, Any]]:
    """Experiments with their repetitions."""
    return [
        {"q": q.tolist(), "wrench": wrench.tolist(), "repeats": int(repeats)}
        for q, wrench, repeats in zip(plan.q, plan.wrench, plan.repeats, strict=True)
    ]


KINDS: dict[type[Sensor], str] = {Marker: "position", PoseMarker: "pose", Distance: "distance"}


def physics_to_dict(model: ElastostaticModel) -> dict[str, Any]:
    """Write instruments, load point and weights as plain data [m, kg].

    Returns:
        One key; none where load and measurement are at the tool point.
    """
    if model.is_plain:
        return {}
    return {
        "physics": {
            "sensors": [_sensor(sensor) for sensor in model.whole_instruments],
            "load_point": place_to_dict(model.load_point),
            "weights": [] if model.weights is None else weights_to_list(model.weights),
        }
    }


def weights_to_list(weights: DeadWeights) -> list[dict[str, Any]]:
    """Mass [kg] and centre of mass of each weight, and compensators."""
    parts = zip(weights.masses, weights.centers, strict=True)
    masses = [{"mass": mass, **place_to_dict(center)} for mass, center in parts]
    return masses + [_pull(pull) for pull in weights.pulls]


def gives_to_dict(gives: GivingWay | None) -> dict[str, Any]:
    """How joints with compensators give way: one key; none without any."""
    if gives is None:
        return {}
    pulls = [_pull(pull) for pull in gives.pulls]
    return {"gives": {"pulls": pulls, "compliances": gives.compliances.tolist()}}


def _pull(pull: Pull) -> dict[str, Any]:
    """A compensator, in SI units."""
    given = pull.given
    return {
        "pull": given.medium,
        "joint": pull.place,
        "anchors": [given.before.tolist(), given.behind.tolist()],
        "stiffness": given.stiffness,
        "preload": given.preload,
    }


def _sensor(sensor: Sensor) -> dict[str, Any]:
    anchor = {"anchor": sensor.anchor.tolist()} if isinstance(sensor, Distance) else {}
    return {"kind": KINDS[type(sensor)], **place_to_dict(sensor.point), **anchor}


def place_to_dict(point: BodyPoint) -> dict[str, Any]:
    """Offset (3,) of a point [m], in the frame of the joint of this index, or of the tool."""
    return {"offset": point.offset.tolist(), "joint": point.joint}


def feasible_to_dict(study: Study, space: DesignSpace) -> dict[str, Any]:
    """Write the robot, the constraints and the free joints as plain data.

    Args:
        study: The study.
        space: The design space that was searched, with the poses that it excludes.

    Returns:
        The keys `robot`, `workspace`, `excluded`, `free`, `fixed` and `margin`, in SI units and
        radians, but for the study's own keys, which name their units; and `coupled_margin`, where
        joints are coupled.
    """
    # Joints that turn without end are cut nowhere.
    robot = space.workspace.robot
    margin = robot.limits[0] - study.robot.limits[0]
    of_coupled = robot.bounds.coupled.limits[0] - study.robot.bounds.coupled.limits[0]
    excluded = [
        {"poses": part.poses.tolist(), "distance": part.distance}
        for part in space.workspace.constraints
        if isinstance(part, Excluded)
    ]
    return {
        "robot": _robot(study.robot),
        "workspace": study.specification.workspace.model_dump(mode="json", exclude_none=True),
        "excluded": excluded,
        "free": list(space.free),
        "fixed": space.fixed.tolist(),
        **({"margin": margin.tolist()} if margin.any() else {}),
        **({"coupled_margin": of_coupled.tolist()} if of_coupled.any() else {}),
    }


def _robot(robot: Robot) -> dict[str, Any]:
    """The chain: transforms [m], axes, limits [rad or m]; masters by their index among the free."""
    index = robot.joint_names.index
    follows: dict[str, Any] = {}
    for tied in robot.tied:
        first, *more = ({"joint": index(name), "factor": factor} for name, factor in tied.follows)
        follows[tied.name] = first | {"offset": tied.offset} | ({"others": more} if more else {})
    coupled: dict[str, list[dict[str, Any]]] = {}
    for one in robot.couplings:
        limits = {} if one.limits is None else {"limits": list(one.limits)}
        entry = {"joint": index(one.follows), "factor": one.factor} | limits
        coupled.setdefault(one.joint, []).append(entry)
    joints = [
        {
            "name": joint.name,
            "kind": joint.kind,
            "origin": joint.origin.tolist(),
            "axis": joint.axis.tolist(),
            "limits": list(joint.limits),
            **({"continuous": True} if joint.continuous else {}),
            **({"follows": follows[joint.name]} if joint.name in follows else {}),
            **({"coupled": coupled[joint.name]} if joint.name in coupled else {}),
        }
        for joint in robot.chain
    ]
    return {
        "name": robot.name,
        "base": robot.base.tolist(),
        "tool": robot.tool.tolist(),
        "joints": joints,
    }


def setting_to_dict(study: Study, space: DesignSpace, criterion: str) -> dict[str, Any]:
    """Write robot, load, noise, constraints and test pose as plain data.

    All is in SI units and radians, but for the study's own keys, which name their units.

    Args:
        study: The study.
        space: The design space that was searched, with the poses that it excludes.
        criterion: Name of the criterion of the design: not all count what is uncertain besides.
    """
    study = study.designed_for(criterion)
    return {
        **feasible_to_dict(study, space),
        "unknown": list(study.model.joints),
        "rows": study.model.rows,
        **({"sigma": study.sigma.tolist()} if study.noise is None else study.noise.to_dict()),
        "load": _load(study),
        "test_pose": _test_pose(study),
        **physics_to_dict(study.model),
        **gives_to_dict(study.model.gives),
        **_friction(study.friction),
        **sight_to_dict(study, study.sight),
        **({} if study.interest is None else {"interest": study.interest.tolist()}),
        **({} if study.prior_information is None else {"prior": _prior(study.prior_information)}),
    }


def sight_to_dict(study: Study, sight: Sight | None) -> dict[str, Any]:
    """Which instruments are read where, in metres and radians: one key; none where all are.

    Args:
        study: Says whether each has to be read.
        sight: Eyes, and the instruments' markers.
    """
    if sight is None:
        return {}
    table = study.specification.sight
    return {
        "sight": {
            "eyes": [_eye(eye) for eye in sight.eyes],
            "markers": [None if one is None else _reflector(one) for one in sight.reflectors],
            "needs_all": int(table is not None and table.all_markers),
            **({} if sight.beams is None else {"beams": _beams(sight.beams)}),
        }
    }


def _beams(beams: Beams) -> dict[str, Any]:
    """What may hide a marker: all convex solids of a cell, in the frames of their carriers."""
    solids = []
    for body in beams.cell.bodies:
        carried = {} if body.carrier is None else {"carrier": body.carrier}
        hung = {} if body.hangs_at is None else {"hangs_at": body.hangs_at.tolist()}
        solids += [_solid(shape) | carried | hung for shape in body.shapes]
    return {"radius": beams.radius, "own": beams.own, "solids": solids}


def _solid(shape: Shape) -> dict[str, Any]:
    if isinstance(shape, Capsule):
        size = [*shape.start.tolist(), *shape.end.tolist(), shape.radius]
        return {"kind": "capsule", "size": size}
    if isinstance(shape, Plane):
        return {"kind": "plane", "size": [*shape.normal.tolist(), shape.offset]}
    if isinstance(shape, Box):
        return {"kind": "box", "size": shape.half.tolist(), "frame": shape.pose.tolist()}
    size = [shape.radius, shape.half_height]
    return {"kind": "cylinder", "size": size, "frame": shape.pose.tolist()}


def _eye(eye: Eye) -> dict[str, Any]:
    nearest, farthest = eye.distance
    limits = {"azimuth": eye.azimuth, "elevation": eye.elevation}
    return {
        "position": eye.position.tolist(),
        "axes": eye.axes.tolist(),
        "nearest": nearest,
        **({"farthest": farthest} if np.isfinite(farthest) else {}),
        **{name: list(pair) for name, pair in limits.items() if pair is not None},
        **({} if eye.cone is None else {"cone": eye.cone}),
    }


def _reflector(one: Reflector) -> dict[str, Any]:
    if one.normal is None:
        return place_to_dict(one.point)
    looks = {"normal": one.normal.tolist(), "acceptance": one.acceptance}
    return place_to_dict(one.point) | looks


def _friction(friction: Friction | None) -> dict[str, Any]:
    """What friction may hold, in SI units: one key; none where it counts for nothing."""
    if friction is None:
        return {}
    sizes = {"k": friction.k.tolist(), "load": friction.load.tolist()}
    return {"friction": sizes | {"share": friction.share}}


def _prior(information: Array) -> list[list[float]]:
    """Rows F (r, p) of measurements that tell as much as the prior: ``F'F`` is its information."""
    r, V, d = unit_spectrum(information)
    kept = r > len(r) * ROUNDING * r[-1]
    return (np.sqrt(r[kept])[:, None] * V[:, kept].T * d).tolist()


def _load(study: Study) -> dict[str, Any]:
    """The keys of the load; a payload in its stead is the force of its weight, none is zero."""
    keys = study.specification
    if keys.load is None and keys.payload is None:
        return {"F_N": [0.0, 0.0, 0.0], "T_Nm": [0.0, 0.0, 0.0]}
    if keys.load is not None:
        return keys.load.model_dump(mode="json", exclude_none=True, exclude={"at_mm"})
    return {"F_N": keys.build_load().wrench(np.zeros(0))[:3].tolist(), "T_Nm": [0.0, 0.0, 0.0]}


def _test_pose(study: Study) -> dict[str, Any] | list[dict[str, Any]] | None:
    """The task, several tasks with their weights, or None."""
    if len(study.tasks) < 2:
        return _task(study.tasks[0]) if study.tasks else None
    return [_task(task) | {"weight": task.weight} for task in study.tasks]


def _task(task: Task) -> dict[str, Any]:
    """Pose [rad or m], tool [m] and wrench [N, N m] of a task.

    Where a neighbourhood [rad] or rotations [m] count, their size follows.
    """
    hanging = task.dead_weights
    sizes = {"within": task.within, "lever": task.lever}
    return {
        "q": task.q.tolist(),
        "tool": task.placed.tool.tolist(),
        "wrench": task.wrench.tolist(),
        **{name: size for name, size in sizes.items() if size},
        **({} if hanging is None else {"weights": weights_to_list(hanging)}),
    }

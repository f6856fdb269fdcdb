"""Which model a sheet needs: pieces beside ideal springs, weighed against each other."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from edtk.calibration.calibrate import calibrate
from edtk.calibration.calibration import UNDECIDED, Calibration, Extension, WeighedModel
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.findings.causes.evidence import Evidence, Pieces, Weighed
from edtk.findings.causes.faults import (
    LEVERS,
    USUAL_ACROSS,
    USUAL_BALANCE,
    USUAL_BY_SIGN,
    USUAL_LAW,
    USUAL_PLAY,
    is_one_of,
    is_sprung,
    lateral_axes,
    own_compliance,
)
from edtk.findings.causes.scene import AXES, Displacements, turned_by
from edtk.findings.causes.try_faults import PlainFit
from edtk.findings.fitted_data import HowFitted
from edtk.fit.correlated_noise import whiten_columns
from edtk.measure.pose_table import Table
from edtk.measure.springs import LAWS
from edtk.measure.task import Tasks
from edtk.study.study import Study
from edtk.study.study_model import assumed_joints
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

MOST_PIECES = 10  # of a model
PAIRED = 8  # likeliest pieces, of which pairs are tried where no single one helps
LEAST_WEIGHT = 1e-3  # of a model that counts
COMPENSATOR = "compensator"
# Where a compensator of a result is said to be: what it does is the same for any such anchors.
LONGER_LEVER = 0.65  # [m]
LOG_RATIO = math.log(LEVERS)  # of the shorter lever over it, where a search begins
PHASES = np.arange(4) * np.pi / 2  # of the anchors, likewise


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece that a robot may have beside ideal springs.

    Attributes:
        name: Its name, as in `springs` of [parameters]; "compensator.q2" for a compensator.
        columns: What readings show of a unit of each of its numbers (m, rows, c), SI.
        usual: Sizes (c,) that these usually have.
        positive: Whether they are never negative.
    """

    name: str
    columns: Array
    usual: Array
    positive: bool = False


def pieces_of(scene: Displacements) -> Iterator[Piece]:
    """All pieces that readings may show: of a sheet, or the same in a task."""
    sheet = scene.sheet
    for j, joint in enumerate(scene.robot.joints):
        usual = np.array([USUAL_ACROSS * own_compliance(sheet, j)])
        for axis in lateral_axes(joint):
            if usual[0] > 0 and not is_sprung(sheet, j, axis):
                column = scene.across(j, axis)[..., None]
                yield Piece(f"{joint.name}.r{AXES[axis]}", column, usual, positive=True)
    for i, j in enumerate(sheet.sprung):
        yield from _of_joint(scene, i, scene.robot.joints[j].name, own_compliance(sheet, j))


def _of_joint(scene: Displacements, i: int, name: str, own: float) -> Iterator[Piece]:
    """Laws of a joint's spring, and a compensator at the joint.

    Displacements hardly show a compensator, and it does them no harm. Of positions that are counted
    from the rigid robot its torque makes ``k T``, a wave of the joint's angle and a smaller one of
    twice the frequency, as the levers of its anchors have it.
    """
    sheet = scene.sheet
    most = float(np.abs(sheet.torque[:, i]).max(initial=0.0))
    if not (most > 0 and own > 0):
        return
    joint = scene.robot.joints[sheet.sprung[i]]
    for law, size in law_sizes(joint.kind, own, most).items():
        of_sheet = sheet.law(i, LAWS[law][0])[..., None]
        if is_one_of(sheet.A, of_sheet):
            continue  # as of a sign where all torques have the same
        column = scene.law(i, LAWS[law][0])[..., None]
        yield Piece(f"{name}.{law}", column, np.array([size]), positive=law == "gap")
    stated = any(one.joint == name for one in scene.robot.compensators)
    if sheet.absolute and joint.kind == "revolute" and not stated:
        q = scene.q[:, sheet.sprung[i]]
        usual = USUAL_BALANCE * own * most * np.array([1, 1, LEVERS / 2, LEVERS / 2])
        yield Piece(
            f"{COMPENSATOR}.{name}", scene.motion[..., i, None] * waves_of(q)[:, None], usual
        )


def law_sizes(kind: str, own: float, most: float) -> dict[str, float]:
    """Usual sizes of the laws of a spring, beside its compliance, under loads up to the most."""
    return {
        "square": USUAL_LAW * own / most,
        "cubic": USUAL_LAW * own / most**2,
        "sign": USUAL_BY_SIGN * own,
        "gap": USUAL_PLAY[kind],
    }


def waves_of(q: Array) -> Array:
    """The waves (m, 4) of a compensator's torque at angles q (m,)."""
    return np.stack([np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q)], axis=-1)


@dataclass(frozen=True, eq=False)
class Search:
    """Models of a sheet, each weighed once.

    Attributes:
        pieces: The pieces that are tried.
        evidence: The readings in units of their noise.
        whitened: Columns (N, c) of each piece, in the same units.
        A: Regressors (m, rows, p) of the readings.
        measured: The readings (m, rows).
        pose: Number (m,) of the pose of each.
    """

    pieces: tuple[Piece, ...]
    evidence: Evidence
    whitened: tuple[Array, ...]
    A: Array
    measured: Array
    pose: Indices

    @cached_property
    def weighed(self) -> dict[frozenset[int], Weighed]:
        """All models that were weighed."""
        return {}

    def together(self, chosen: frozenset[int]) -> Pieces:
        """Some pieces side by side, in their order."""
        own = [self.pieces[i] for i in sorted(chosen)]
        empty = np.zeros((len(self.evidence.y), 0))
        positive = [np.full(len(one.usual), one.positive) for one in own]
        return Pieces(
            np.concatenate([empty, *(self.whitened[i] for i in sorted(chosen))], axis=1),
            np.concatenate([np.zeros(0), *(one.usual for one in own)]),
            np.concatenate([np.zeros(0, dtype=bool), *positive]),
        )

    def score(self, chosen: frozenset[int]) -> float:
        """Twice the negative logarithm of a model's posterior probability.

        Beforehand any number of pieces is as likely, and of as many any choice (Scott and Berger
        2010): so a piece more costs the more, the more there are to choose from.
        """
        if chosen not in self.weighed:
            self.weighed[chosen] = self.evidence.weigh(self.together(chosen))
        n = len(self.pieces)
        return self.weighed[chosen].score + 2 * math.log((n + 1) * math.comb(n, len(chosen)))

    def run(self) -> None:
        """Add and remove the piece that helps most, or two where no single one does."""
        best: frozenset[int] = frozenset()
        every = range(len(self.pieces))
        while True:
            free = [i for i in every if i not in best]
            more = [best | {i} for i in free if len(best) < MOST_PIECES]
            less = [best - {i} for i in best]
            near = sorted((*more, *less), key=self.score)
            if near and self.score(near[0]) < self.score(best):
                best = near[0]
                continue
            likely = sorted(free, key=lambda i: self.score(best | {i}))[:PAIRED]
            pairs = [best | {i, j} for n, i in enumerate(likely) for j in likely[:n]]
            pairs = [one for one in pairs if len(one) <= MOST_PIECES]
            if not pairs or self.score(min(pairs, key=self.score)) >= self.score(best):
                return
            best = min(pairs, key=self.score)

    def left_out(self, chosen: frozenset[int]) -> float:
        """Root mean square distance of poses that a model predicts from the others.

        With the weighted columns B, their prior ``T^-2`` and ``G = B'B + T^-2``, the parameters
        without a pose b are ``x - G^-1 B_b' (I - B_b G^-1 B_b')^-1 r_b``.
        """
        one = self.weighed[chosen]
        pieces = self.together(chosen)
        rows = self.evidence.rows
        w = 1 / np.sqrt(1 + one.share**2 * rows.e)
        B = np.hstack([self.evidence.X, rows.turned(pieces.columns)]) * w[:, None]
        y = self.evidence.y * w
        # A width of nothing known is that of parameters, of which nothing is known before.
        p = self.evidence.X.shape[1]
        prior = np.zeros(B.shape[1])
        prior[p:] = 1 / (one.width * pieces.usual)
        length = np.sqrt((B**2).sum(axis=0) + prior**2)
        R = np.linalg.qr(np.vstack([B, np.diag(prior)]) / length, mode="r")
        inverse = np.linalg.inv(R) / length[:, None]
        G = inverse @ inverse.T
        x = G @ (B.T @ y)
        raw = [self.A, *(self.pieces[i].columns for i in sorted(chosen))]
        columns = np.concatenate(raw, axis=-1)
        squares = 0.0
        per_pose = zip(*self._by_pose, strict=True)
        for members, place in per_pose:
            r = y[place] - B[place] @ x
            gain = B[place] @ G @ B[place].T
            shift = G @ B[place].T @ np.linalg.lstsq(np.eye(len(place)) - gain, r, rcond=None)[0]
            apart = self.measured[members] - columns[members] @ (x - shift)
            squares += float((apart**2).sum())
        return math.sqrt(squares / len(self.measured))

    @cached_property
    def _by_pose(self) -> tuple[list[Indices], list[Indices]]:
        """Measurements, and coordinates, of each pose."""
        rows = self.measured.shape[1]
        members = [np.flatnonzero(self.pose == one) for one in np.unique(self.pose)]
        places = [(own[:, None] * rows + np.arange(rows)).ravel() for own in members]
        return members, places


@dataclass(frozen=True, eq=False)
class InTasks:
    """What models say of the tasks.

    Attributes:
        A: Regressors (t, rows, p) of the parameters.
        pieces: Columns (t, rows, c) of each piece.
        bends: What each spring moves there (t, rows, p), for errors of the model.
        shares: Weights (t,) of the tasks.
    """

    A: Array
    pieces: list[Array]
    bends: Array
    shares: Array

    @classmethod
    def of(cls, plain: PlainFit, tasks: Tasks) -> "InTasks":
        """Of a study's tasks, in their test poses."""
        scenes = [plain.scene.in_task(task) for task in tasks]
        each = [[piece.columns for piece in pieces_of(scene)] for scene in scenes]
        A = np.concatenate([scene.A for scene in scenes])
        pieces = [np.concatenate(one) for one in zip(*each, strict=True)]
        return cls(A, pieces, A * plain.k, tasks.shares)

    def of_model(self, chosen: frozenset[int], one: Weighed) -> tuple[Array, Array]:
        """Displacements (t, rows), and mean squares (t,) of what is not known of them."""
        T = np.concatenate([self.A, *(self.pieces[i] for i in sorted(chosen))], axis=-1)
        unsure = np.einsum("trp,pq,trq->t", T, one.covariance, T)
        left = one.share**2 * (self.bends**2).sum(axis=(1, 2))
        return T @ one.mean, unsure + left

    def mean(self, squares: Array) -> float:
        """Root of the weighted mean of squares (t,) over the tasks."""
        return math.sqrt(float(self.shares @ squares))


def extend(study: Study, sheet: Table, how: HowFitted) -> Calibration:
    """Find the richest model that a sheet supports, and calibrate with it.

    Models are nested: ideal springs, and any pieces beside them. Each is weighed by its marginal
    likelihood, with the sizes that pieces usually have before, beside an error that each pose has
    by itself; see `Evidence` and `Search`.

    Args:
        study: A study of springs by displacements.
        sheet: The measurements.
        how: How they are fitted.

    Returns:
        The calibration by the likeliest model, with all of them.
    """
    found = calibrate(study, sheet, how)
    plain, search = _search_of(found)
    tasks = InTasks.of(plain, study.tasks) if study.tasks else None
    parts = {} if found.budget is None else found.budget.parts
    others = [part for name, part in parts.items() if name not in ("noise", "model")]
    extension = extension_of(search, tasks, others, partial(_study_of, found.study, plain, search))
    if extension.study is found.study:
        budget = found.budget
        if budget is not None:
            budget = replace(budget, model=float(np.hypot(budget.model, extension.undecided)))
        return replace(found, extension=extension, budget=budget)
    from edtk.calibration.calibrate_geometry import calibrate_geometry

    return replace(calibrate_geometry(extension.study, sheet, how), extension=extension)


def extension_of(
    search: Search,
    tasks: InTasks | None,
    others: Sequence[float],
    study_of: Callable[[frozenset[int]], Study],
) -> Extension:
    """Search the models of a sheet, and weigh those that count.

    Args:
        search: The models.
        tasks: What they say of the study's tasks; None without any.
        others: Errors to expect there besides [m].
        study_of: The study of a model.
    """
    search.run()
    scores = {chosen: search.score(chosen) for chosen in search.weighed}
    least = min(scores.values())
    weights = {chosen: math.exp(-(score - least) / 2) for chosen, score in scores.items()}
    total = sum(weights.values())
    nothing: frozenset[int] = frozenset()
    counted = {
        chosen: w / total
        for chosen, w in weights.items()
        if w / total > LEAST_WEIGHT or chosen == nothing
    }
    order = sorted(counted, key=lambda chosen: -counted[chosen])
    models = tuple(_model(search, tasks, chosen, counted[chosen]) for chosen in order)
    names = [one.name for one in search.pieces]
    inclusion = {
        name: math.fsum(w for chosen, w in weights.items() if i in chosen) / total
        for i, name in enumerate(names)
    }
    inclusion = {name: p for name, p in inclusion.items() if p > UNDECIDED}
    undecided, expected = _error(search, tasks, order, models, others)
    return Extension(models, len(weights), inclusion, undecided, expected, study_of(order[0]))


def _search_of(found: SpringCalibration) -> tuple[PlainFit, Search]:
    """The fit of a sheet without its outliers, and the models."""
    fitted = found.fitted
    data, rows = fitted.data, np.arange(len(fitted.data))
    off = np.union1d(fitted.fit.outliers, np.array(fitted.found_causes.outliers, dtype=int))
    rows = np.setdiff1d(rows, off)
    study = found.study
    plain = PlainFit.of(
        study.model, data[rows], fitted.as_linear[rows], study.known, fitted.told_before
    )
    plain = replace(plain, assumed=assumed_joints(study, np.maximum(fitted.fit.k, 0.0)))
    pure, dof = plain.pure_error
    noise = math.sqrt(pure / dof) if dof else 1.0
    if fitted.fit.known:
        noise = max(noise, 1.0)
    elif not dof:
        noise = fitted.fit.scale
    pieces = tuple(pieces_of(plain.scene))
    whitened = tuple(_whitened(plain, one.columns) / noise for one in pieces)
    measured = plain.measured_rows(plain.measured)
    return plain, Search(
        pieces, _evidence(plain, noise), whitened, plain.A, measured, plain.data.pose
    )


def _evidence(plain: PlainFit, noise: float) -> Evidence:
    """The readings, whose noise is so many times as large as stated."""
    A = plain.A if plain.prior is None else plain.prior.below(plain.A)
    found = plain.evidence(A, plain.measured)
    rows = replace(found.rows, e=found.rows.e / noise**2)
    return Evidence(rows, found.y / noise, found.X / noise)


def _whitened(plain: PlainFit, columns: Array) -> Array:
    """Columns (N, c) in units of the stated noise, of a piece's (m, rows, c)."""
    if plain.prior is not None:
        below = plain.prior.zeros_below(np.moveaxis(columns, -1, 0))
        columns = np.moveaxis(below, 0, -1)
    whitened = whiten_columns(columns, plain.noise)
    return whitened.reshape(-1, whitened.shape[-1])


def _model(
    search: Search, tasks: InTasks | None, chosen: frozenset[int], weight: float
) -> WeighedModel:
    """A model with what it says of left out poses, and of the tasks."""
    one = search.weighed[chosen]
    expected = math.nan if tasks is None else tasks.mean(tasks.of_model(chosen, one)[1])
    names = tuple(search.pieces[i].name for i in sorted(chosen))
    return WeighedModel(names, one, weight, search.left_out(chosen), expected)


def _error(
    search: Search,
    tasks: InTasks | None,
    order: Sequence[frozenset[int]],
    models: Sequence[WeighedModel],
    others: Sequence[float],
) -> tuple[float, float]:
    """What remains undecided in the tasks, and the error to expect there [m].

    With the weights w of the models and their displacements d, commands are for those of the
    likeliest one, d_1: they are off by ``sum_m w_m (|d_m - d_1|^2 + unsure_m)``, mean square.
    """
    if tasks is None:
        return math.nan, math.nan
    said = [tasks.of_model(chosen, search.weighed[chosen]) for chosen in order]
    w = np.array([one.weight for one in models])
    w = w / w.sum()
    apart = np.array([((moved - said[0][0]) ** 2).sum(axis=1) for moved, _ in said])
    unsure = np.array([squares for _, squares in said])
    total = float(np.linalg.norm([tasks.mean(w @ (apart + unsure)), *others]))
    return tasks.mean(w @ apart), total


def _study_of(study: Study, plain: PlainFit, search: Search, chosen: frozenset[int]) -> Study:
    """The study with the pieces of a model; the same without any.

    Raises:
        UserError: The study cannot have them.
    """
    if not chosen:
        return study
    weighed = search.weighed[chosen]
    p = search.evidence.X.shape[1]
    sizes = weighed.mean[p:]
    springs = [*study.specification.joints.unknown]
    tables = []
    for i in sorted(chosen):
        name = search.pieces[i].name
        own, sizes = np.split(sizes, [len(search.pieces[i].usual)])
        if name.startswith(COMPENSATOR):
            joint = name.removeprefix(f"{COMPENSATOR}.")
            k = float(weighed.mean[study.specification.joints.unknown.index(joint)])
            q = plain.data.q[:, study.robot.joint_names.index(joint)]
            tables.append(_compensator_table(study, joint, q, waves_of(q) @ own / k))
        else:
            springs.append(name)
    given = study.to_dict()
    joints = {key: value for key, value in given.get("joints", {}).items() if key != "unknown"}
    asked: dict[str, Any] = {"springs": springs, "geometry": [], "base": False, "tool": False}
    if tables:
        asked["compensators"] = [table["joint"] for table in tables]
    robot = given["robot"]
    if tables:
        table = {"file": robot} if isinstance(robot, str) else dict(robot)
        robot = table | {"compensator": [*table.get("compensator", []), *tables]}
    names = [search.pieces[i].name for i in sorted(chosen)]
    return with_pieces(study, names, joints=joints, parameters=asked, robot=robot)


def with_pieces(study: Study, names: Sequence[str], **keys: Any) -> Study:
    """The study with other keys, for pieces of some names.

    Raises:
        UserError: The study cannot have them.
    """
    try:
        return study.replace(**keys)
    except UserError as error:
        message = f"the likeliest model has {', '.join(names)}, which this study cannot have"
        raise UserError(f"{message}: {error}") from error


def _compensator_table(study: Study, joint: str, q: Array, torque: Array) -> dict[str, Any]:
    """A coil that turns a joint as was found.

    With anchors at the distances a and L from the axis it pulls with ``F = P + c (s - s0)``, and
    turns the joint by ``T = F a L sin(x) / s``, with ``s^2 = a^2 + L^2 + 2 a L cos x`` and
    ``x = q + phi``. Where L is stays open, as other anchors do the same: a, phi, c and P are those
    that leave least of the torque.

    Args:
        study: The study.
        joint: Name of the joint.
        q: Its angles (m,) in the sheet [rad].
        torque: What was found there (m,) [N m].
    """
    from scipy.optimize import least_squares

    own = study.robot.joints[study.robot.joint_names.index(joint)]
    L, size = LONGER_LEVER, float(np.abs(torque).max())

    def pull(x: Array) -> tuple[float, float, float, float]:
        """Lever [m], phase [rad], stiffness [N/m] and preload [N] of numbers of order one."""
        a = L * float(np.exp(x[0]))
        return a, float(x[1]), float(x[2] ** 2) * size / (a * L), float(x[3]) * size / a

    def left(x: Array) -> Array:
        a, phase, c, P = pull(x)

        def length(angle: Array) -> Array:
            return np.asarray(np.sqrt(a**2 + L**2 + 2 * a * L * np.cos(angle + phase)))

        s = length(q)
        force = P + c * (s - length(np.zeros(1)))
        return np.asarray(force * a * L * np.sin(q + phase) / s / size - torque / size)

    starts = [np.array([LOG_RATIO, phase, 0.5, 0.5]) for phase in PHASES]
    bounds = ([LOG_RATIO - 3, -np.inf, -np.inf, -np.inf], [-0.1, np.inf, np.inf, np.inf])
    tried = [least_squares(left, start, bounds=bounds) for start in starts]
    a, phase, c, P = pull(min(tried, key=lambda one: one.cost).x)
    before = L * own.aligned[:, 0]
    behind = -a / L * turned_by(phase * own.axis, before)
    return {
        "joint": joint,
        "anchors_mm": [(1e3 * before).tolist(), (1e3 * behind).tolist()],
        "stiffness_N_per_mm": c / 1e3,
        "preload_N": P,
    }

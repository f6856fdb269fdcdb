"""Finding signs, zeros and coupling of the joints from measured positions."""

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from edtk.fit.controller.fits import Fits, Positions, descend, jacobian, place_frames
from edtk.fit.controller.ways_to_count import Counted, SameArm, WayToCount, same_arms, ways_to_count
from edtk.fit.distributions import fisher_quantile
from edtk.robots.robot import Robot
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

SPREAD = (16, 4, 1024)  # further offsets, spread evenly: 16 times 4 for each, at most 1024
MOST_JOINTS = 8  # that move; each doubles the signs to try


QUARTERS = np.deg2rad([0.0, 90.0, 180.0, -90.0])  # zeros that makers choose


@dataclass(frozen=True)
class SearchOfOffsets:
    """How offsets of joints are searched, and when a way to count is told."""

    most_quarters: int = 1024  # combinations of quarter turns; where there are more, none is tried
    # Of all offsets those that begin best are improved a little, and of these a few to the end.
    begin: int = 64  # offsets that are improved
    short: int = 6  # steps that improve a little
    finish: int = 6  # offsets that go to the end
    long: int = 30  # steps to the end
    most_together: int = 100_000  # fits times positions: each takes some kilobytes
    polish: int = 40  # steps of the best fits
    many_positions: int = 12  # positions from which a part is enough to tell signs
    rank: float = 1e-7  # share of a column that others do not explain, from which it is told
    clear: float = 3.0  # factor of the rms by which every other way has to be worse
    sure: float = 0.999  # probability that errors alone make a smaller factor than that
    most_others: int = 5  # ways beside the best that are fitted to all positions, and may be told
    far_off: float = 0.01  # rms beside the reach: nominal arms are wrong by a thousandth
    generic: int = 5  # seeds of places at which the numbers that can be told are looked for


SEARCH = SearchOfOffsets()


def search(
    robot: Robot, ways: tuple[WayToCount, ...], positions: Positions, free: list[int]
) -> Fits:
    """Find the best fit of each way to count.

    Args:
        robot: The chain, its tool frame the flange.
        ways: The ways (w,).
        positions: The measurements.
        free: Joints whose offsets are told by such measurements.

    Returns:
        One fit for each way (w,).
    """
    offsets = _offsets(robot, free)
    markers = len(positions.names)
    lots = []
    for way in ways:
        counting = np.broadcast_to(way.counting, (len(offsets), robot.n, robot.n))
        begun = place_frames(robot, Fits.at(counting, offsets, markers), positions)
        lots.append(begun[np.argsort(begun.rms)[: SEARCH.begin]])
    size = len(lots[0])
    together = max(1, SEARCH.most_together // (size * len(positions)))
    found = []
    for first in range(0, len(lots), together):
        begun = Fits.joined(lots[first : first + together])
        short = descend(robot, begun, positions, free, SEARCH.short)
        long = descend(robot, _best(short, size, SEARCH.finish), positions, free, SEARCH.long)
        found.append(_best(long, min(size, SEARCH.finish), 1))
    return Fits.joined(found)


def _best(fits: Fits, size: int, kept: int) -> Fits:
    """Of each lot of `size` fits the best ones."""
    rms = fits.rms.reshape(-1, size)
    order = np.argsort(rms, axis=1)[:, :kept] + size * np.arange(len(rms))[:, None]
    return fits[order.reshape(-1)]


def _offsets(robot: Robot, free: list[int]) -> Array:
    """Offsets (s, n) to begin with; those of joints that slide begin at zero."""
    from scipy.stats import qmc

    turning = [j for j in free if robot.joints[j].kind != "prismatic"]
    if not turning:
        return np.zeros((1, robot.n))
    first, factor, most = SPREAD
    count = min(first * factor ** len(turning), most)
    spread = (2 * qmc.Sobol(len(turning), seed=0).random(count) - 1) * np.pi
    parts = [spread]
    if len(QUARTERS) ** len(turning) <= SEARCH.most_quarters:
        parts.append(np.array(list(product(QUARTERS, repeat=len(turning)))))
    values = np.concatenate(parts)
    offsets = np.zeros((len(values), robot.n))
    offsets[:, turning] = values
    return offsets


@dataclass(frozen=True, eq=False)
class FoundController(Presented):
    """The way to count that fits measured positions best, and how sure it is.

    Attributes:
        robot: Name of the robot.
        best: Signs, zeros and coupling.
        zero_std: Standard deviations (n,) of the zeros, from what the fit leaves [deg, mm].
        untold: What else would have to be known for a joint's zero, by joint.
        same: Other ways to count that describe the same arm, which no such measurement tells apart.
        second: The best of all other ways; None if there is no other.
        others: Ways that fit nearly as well as the best one.
        clear: Whether no other way comes near.
        poses: Number of poses.
        coordinates: Number of measured coordinates, the mean of repetitions counted once.
        unknowns: Number of fitted numbers.
        markers: Names of the markers.
        marker: Their places (k, 3) in the flange's frame [m].
        base: Pose (4, 4) of the robot's base in the instrument's frame [m].
        far_off: Whether even the best way leaves more than such an arm can be wrong by.
        left_out: Sentences on positions that cannot be those of the markers, and do not count.
    """

    robot: str
    best: Counted
    zero_std: Array
    untold: dict[str, str]
    same: tuple[Counted, ...]
    second: Counted | None
    others: tuple[Counted, ...]
    clear: bool
    poses: int
    coordinates: int
    unknowns: int
    markers: tuple[str, ...]
    marker: Array
    base: Array
    far_off: bool
    left_out: tuple[str, ...] = ()

    def headline(self) -> str:
        """What the fit leaves, and whether the answer is clear."""
        clear = "clear" if self.clear else "not clear"
        return f"{self.robot}: {1e3 * self.best.rms:.3g} mm from {self.poses} poses, {clear}"

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers: lengths in metres; zeros in degrees and millimetres, as they are typed."""
        return {
            "controller": self.best.table(),
            "rms": self.best.rms,
            "zero_std": dict(zip(self.best.names, self.zero_std.tolist(), strict=True)),
            "clear": self.clear,
            "untold": self.untold,
            "same": [one.to_dict() for one in self.same],
            "second": None if self.second is None else self.second.to_dict(),
            "others": [one.to_dict() for one in self.others],
            "poses": self.poses,
            "coordinates": self.coordinates,
            "unknowns": self.unknowns,
            "markers": dict(zip(self.markers, self.marker.tolist(), strict=True)),
            "base": self.base.tolist(),
            "far_off": self.far_off,
            "left_out": list(self.left_out),
        }


def find_controller(robot: Robot, positions: Positions) -> FoundController:
    """Find how a controller counts the joints of a robot.

    The robot's joints are ``q = S (I + F) (c - z)``: signs S, a coupling F, zeros z. Unknown
    besides are the frame of the instrument and the markers' places. All signs and couplings are
    tried, those that make the same arm once; for each, offsets that are spread over a turn are
    begun with in closed form and improved by least squares, see `search`.

    Args:
        robot: The chain; its own controller does not count.
        positions: Measured positions, with what the controller showed.

    Raises:
        UserError: There are too few positions to tell anything, or too many joints move.
    """
    if len(positions.moving) > MOST_JOINTS:
        raise UserError(
            f"{len(positions.moving)} joints move, which have too many signs to try; expected "
            f"{MOST_JOINTS} at most, with the others at rest"
        )
    arm = replace(robot, controller=None).with_tool(np.eye(4))
    told = _told(arm, positions)
    unknowns = len(told) + 6 + 3 * len(positions.names)
    freedom = 3 * len(positions) - unknowns
    if freedom < 1:
        raise UserError(
            f"{3 * len(positions)} coordinates are too few for the instrument's frame, "
            f"{len(positions.names)} marker(s) and the joints' zeros; expected more poses"
        )
    same = same_arms(arm, positions.moving)
    ways = ways_to_count(arm, same, positions.moving)
    order, polished = _best_ways(arm, ways, positions, told)
    counted = [
        Counted.of(arm, ways[i], polished.offset[k], positions.shown, told, float(polished.rms[k]))
        for k, i in enumerate(order)
    ]
    limit = counted[0].rms * _worse(freedom)
    alike = _alike(arm, ways[order[0]], polished[:1], positions, told, same)
    best, fit = alike[0]
    return FoundController(
        robot=robot.name,
        best=best,
        zero_std=_zero_std(arm, best.way, fit, positions, told, freedom),
        untold=_untold(arm, fit, positions, told),
        same=tuple(one for one, _ in alike[1:]),
        second=counted[1] if len(counted) > 1 else None,
        others=tuple(one for one in counted[1:] if one.rms <= limit),
        clear=all(one.rms > limit for one in counted[1:]),
        poses=len(positions.shown),
        coordinates=3 * len(positions),
        unknowns=unknowns,
        markers=positions.names,
        marker=fit.marker[0],
        base=_pose(fit),
        far_off=best.rms > SEARCH.far_off * robot.reach,
    )


def _best_ways(
    robot: Robot, ways: tuple[WayToCount, ...], positions: Positions, told: list[int]
) -> tuple[Indices, Fits]:
    """The best ways to count (indices), and their fits to all positions, the best first."""
    few = _few(positions, len(told))
    found = search(robot, ways, few, told)
    order = np.argsort(found.rms, kind="stable")[: SEARCH.most_others + 1]
    begun = found[order]
    if few is not positions:
        begun = Fits.at(begun.counting, begun.offset, len(positions.names))
        begun = place_frames(robot, begun, positions)
    polished = descend(robot, begun, positions, told, SEARCH.polish)
    ranked = np.argsort(polished.rms, kind="stable")
    return order[ranked], polished[ranked]


def _few(positions: Positions, told: int) -> Positions:
    """A part of very many positions that tells as much about signs."""
    if len(positions) <= SEARCH.many_positions:
        return positions
    enough = 3 * min(len(positions.shown), SEARCH.many_positions) >= 2 * (told + 9)
    one = int(np.bincount(positions.marker).argmax()) if enough else None
    return positions.thinned(SEARCH.many_positions, one)


def _worse(freedom: int) -> float:
    """Factor of the rms by which another way has to be worse, so that it is none."""
    return max(SEARCH.clear, float(np.sqrt(fisher_quantile(SEARCH.sure, freedom, freedom))))


def _pose(fit: Fits) -> Array:
    """Pose (4, 4) of the base in the instrument's frame."""
    T = np.eye(4)
    T[:3, :3] = fit.turn[0]
    T[:3, 3] = fit.shift[0]
    return T


def _alike(
    robot: Robot,
    way: WayToCount,
    fit: Fits,
    positions: Positions,
    told: list[int],
    same: tuple[SameArm, ...],
) -> list[tuple[Counted, Fits]]:
    """All ways to count that make the arm of a fit, the simplest first."""
    found = []
    for one in same:
        other = WayToCount(one.sign * way.sign, way.follows)
        offset = one.sign * fit.offset + one.offset
        begun = replace(fit, counting=other.counting[None], offset=offset)
        turn = begun.turn @ one.turn.T
        begun = descend(robot, replace(begun, turn=turn), positions, told, SEARCH.polish)
        rms = float(begun.rms[0])
        counted = Counted.of(robot, other, begun.offset[0], positions.shown, told, rms)
        found.append((counted, begun))
    # Instruments stand upright, as a rule; so does the robot that is not on its head.
    found.sort(key=lambda pair: (pair[1].turn[0, 2, 2] < 0, pair[0].order))
    upright = found[0][1].turn[0, :, 2]
    return [
        (replace(counted, tilt=_angle(begun.turn[0, :, 2], upright)), begun)
        for counted, begun in found
    ]


def _angle(a: Array, b: Array) -> float:
    """The angle between two unit vectors [rad]."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _columns(robot: Robot, fit: Fits, positions: Positions) -> Array:
    """Derivatives (3m, n + 6 + 3k) of the positions by all numbers, of unit length."""
    frames = fit.frames(robot, positions)
    rotation, points = fit.arms(frames, positions)
    J = jacobian(fit, positions, frames, rotation, points, list(range(robot.n)))
    J = J.reshape(-1, J.shape[-1])
    return np.asarray(J / np.maximum(np.linalg.norm(J, axis=0), 1e-300))


def _rest(column: Array, others: Array) -> float:
    """The part of a column (r,) of unit length that others (r, c) do not explain."""
    if not others.size:
        return 1.0
    U, size, _ = np.linalg.svd(others, full_matrices=False)
    U = U[:, size > SEARCH.rank * size[0]]
    return float(np.linalg.norm(column - U @ (U.T @ column)))


def _told(robot: Robot, positions: Positions) -> list[int]:
    """Joints whose zeros positions can tell, those in the middle of the arm first.

    The zero of the first joint turns the base, and that of the last one the tool, so that these
    are the ones that are left out.
    """
    rng = np.random.default_rng(SEARCH.generic)
    markers = len(positions.names)
    offset = rng.uniform(-1, 1, (1, robot.n))
    place = robot.reach * rng.uniform(-0.2, 0.2, (1, markers, 3))
    fit = replace(Fits.at(np.eye(robot.n)[None], offset, markers), marker=place)
    J = _columns(robot, fit, positions)
    kept = J[:, robot.n :]
    told = []
    for j in [*range(1, robot.n - 1), *dict.fromkeys((0, robot.n - 1))]:
        if _rest(J[:, j], kept) > SEARCH.rank:
            kept = np.column_stack([kept, J[:, j]])
            told.append(j)
    return sorted(told)


def _untold(robot: Robot, fit: Fits, positions: Positions, told: list[int]) -> dict[str, str]:
    """Why a joint's zero is not told, by joint."""
    J = _columns(robot, fit, positions)
    base = J[:, robot.n : robot.n + 6]
    tool = J[:, robot.n + 6 :]
    words = {}
    for j in range(robot.n):
        if j not in told:
            if j not in positions.moving:
                why = "the joint stands still in all poses, so that its sign is not told either"
            elif _rest(J[:, j], base) <= SEARCH.rank:
                why = "another zero turns or shifts the robot's base as a whole"
            elif _rest(J[:, j], tool) <= SEARCH.rank:
                why = "another zero turns or shifts the tool as a whole"
            else:
                why = "another zero goes with those of other joints"
            words[robot.joint_names[j]] = why
    return words


def _zero_std(
    robot: Robot, way: WayToCount, fit: Fits, positions: Positions, told: list[int], freedom: int
) -> Array:
    """Standard deviations (n,) of the zeros [deg, mm]; zero where a zero is not told."""
    frames = fit.frames(robot, positions)
    rotation, points = fit.arms(frames, positions)
    J = jacobian(fit, positions, frames, rotation, points, told)
    J = J.reshape(-1, J.shape[-1])
    residual = fit.residual(points, positions)
    scale = np.linalg.norm(J, axis=0)
    covariance = np.linalg.pinv((J / scale).T @ (J / scale)) / np.outer(scale, scale)
    covariance *= (residual**2).sum() / freedom
    offsets = np.zeros((robot.n, len(told)))
    offsets[told, range(len(told))] = 1.0
    to_zero = np.linalg.solve(way.counting, offsets)
    variance = np.einsum("ij,jk,ik->i", to_zero, covariance[: len(told), : len(told)], to_zero)
    return np.asarray(np.sqrt(variance) / robot.units)

"""How a proof divides its nodes: which candidates are set apart, and where they are near."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.design.exact.exact_nodes import Merits, Nodes
from edtk.system.typing import Array, Indices, Mask

LIGHT_IN_GROUP = 1e-3  # part of a group's experiments below which a weight tells nothing
WHOLE = 1e-9  # distance from a whole number that is rounding
# What a part of whole experiments counts: to divide a group of one experiment may be all there is.
COUNTED_AT_LEAST = 1e-4
AXES = 10  # directions along which candidates are ordered, at most


def halved_order(points: Array) -> Indices:
    """An order (n,) of points (n, d) of which each block of 2^b from a multiple of 2^b is compact.

    All are halved across their widest direction, then each half across its own, and so on.
    """
    n = len(points)
    levels = max(0, int(np.ceil(np.log2(max(n, 1)))))
    centred = points - points.mean(axis=0)
    _, V = eigenpairs(centred.T @ centred)
    places = centred @ V[:, ::-1][:, :AXES]
    # Places without a point are beyond all others, so that they stay last in every half.
    places = np.concatenate([places, np.full((2**levels - n, places.shape[1]), np.inf)])
    order = np.arange(2**levels)
    for level in range(levels):
        size = 2 ** (levels - level)
        blocks = places.reshape(-1, size, places.shape[1])
        told = np.isfinite(blocks)
        number = np.maximum(told.sum(axis=1), 1)
        known = np.where(told, blocks, 0.0)
        mean = known.sum(axis=1) / number
        spread = np.square(known).sum(axis=1) / number - np.square(mean)
        axis = spread.argmax(axis=1)
        along = np.take_along_axis(blocks, axis[:, None, None], axis=2)[:, :, 0]
        halves = np.argpartition(along, size // 2 - 1, axis=1)
        moved = (halves + size * np.arange(len(halves))[:, None]).ravel()
        places = places[moved]
        order = order[moved]
    return order[order < n]


class Part(NamedTuple):
    """The candidates (b,) of one group of each node that are set apart.

    Attributes:
        group: The group that is divided, among all groups.
        first: Position at which the part begins.
        stop: Position before which it ends.
    """

    group: Indices
    first: Indices
    stop: Indices


def parts(nodes: Nodes, points: Array) -> Part:
    """Choose what to set apart in each node (b,).

    A part of weight W, not whole, has floor(W) experiments or one more at least. With f the rest,
    and D the distance between the means of the part and of the rest of its group, either costs
    about ``f (1 - f) D^2`` of the merit, to second order. Parts are tried of two kinds: single
    candidates that have weight, and, of each group, one of the two blocks of `halved_order`
    between which the weight, or else the group, is divided at the highest level. A single candidate
    that has another nearby gains little: its weight goes there. So D is its distance to that.

    Args:
        nodes: The nodes, with their weights.
        points: Information (n, d) of the candidates, in units in which merits are about as curved
            in all directions.
    """
    some = np.flatnonzero(nodes.weights > LIGHT_IN_GROUP * nodes.counts[nodes.group_of])
    place = nodes.candidates[some]
    group = nodes.group_of[some]
    weight = nodes.weights[some]
    own = points[place]
    groups = len(nodes.heads)
    total = _sums(own * weight[:, None], group, groups)
    whole = np.bincount(group, weight, groups).astype(float)
    cut, divides = _cuts(nodes, place, group)
    left = place < cut[group]
    of_left = np.bincount(group[left], weight[left], groups).astype(float)
    sum_left = _sums(own[left] * weight[left, None], group[left], groups)
    blocks = _gains(of_left, sum_left, whole, total)
    # Where no weight is divided, or only whole experiments are, the group still may have to be.
    apart = _distances(of_left, sum_left, whole, total)
    blocks = np.where(divides, blocks + COUNTED_AT_LEAST * apart + WHOLE, -1.0)
    near = _nearest(nodes, points, some)
    singles = np.minimum(_gains(weight, own * weight[:, None], whole[group], total[group]), near)
    gains = np.concatenate([blocks, singles])
    group_of = np.concatenate([np.arange(groups), group])
    node_of = nodes.node_of_group[group_of]
    order = np.lexsort((gains, node_of))
    best = order[np.searchsorted(node_of[order], np.arange(nodes.n), side="right") - 1]
    first = np.concatenate([nodes.candidates[nodes.heads], place])
    stop = np.concatenate([cut, place + 1])
    return Part(group_of[best], first[best], stop[best])


def _sums(values: Array, group: Indices, groups: int) -> Array:
    """Sums (groups, d) of values (k, d)."""
    found = np.zeros((groups, values.shape[1]))
    np.add.at(found, group, values)
    return found


def _gains(weight: Array, own: Array, whole: Array, total: Array) -> Array:
    """What setting apart parts of a weight and a sum of points brings, of wholes with theirs."""
    part = np.clip(weight - np.floor(weight + WHOLE), 0.0, 1.0)
    return part * (1 - part) * _distances(weight, own, whole, total)


def _distances(weight: Array, own: Array, whole: Array, total: Array) -> Array:
    """Squares (k,) of the distances between the means of parts and rests, if there are both."""
    rest = whole - weight
    divides = (weight > WHOLE) & (rest > WHOLE)
    safe = np.where(divides, weight, 1.0)
    safe_rest = np.where(divides, rest, 1.0)
    apart = own / safe[:, None] - (total - own) / safe_rest[:, None]
    return np.where(divides, np.square(apart).sum(axis=1), 0.0)


def _nearest(nodes: Nodes, points: Array, some: Indices) -> Array:
    """What setting apart some candidates (k,) brings, whose weights go to a neighbour in order."""
    end = len(nodes.candidates) - 1
    part = np.clip(nodes.weights[some] - np.floor(nodes.weights[some] + WHOLE), 0.0, 1.0)
    own = points[nodes.candidates[some]]
    found = np.full(len(some), np.inf)
    for other in (np.maximum(some - 1, 0), np.minimum(some + 1, end)):
        distance = np.square(own - points[nodes.candidates[other]]).sum(axis=1)
        near = (nodes.group_of[other] == nodes.group_of[some]) & (other != some)
        found = np.minimum(found, np.where(near, distance, np.inf))
    return part * (1 - part) * np.where(np.isfinite(found), found, 0.0)


def _cuts(nodes: Nodes, place: Indices, group: Indices) -> tuple[Indices, Mask]:
    """The position (g,) that divides the weights of each group, or else the group, and whether.

    It is the multiple of the largest power of two between the first and the last.
    """
    each = np.arange(len(nodes.heads))
    first = np.searchsorted(group, each)
    last = np.searchsorted(group, each, side="right") - 1
    low = place[np.minimum(first, len(place) - 1)]
    high = place[last]
    alone = (last < first) | (low == high)
    low = np.where(alone, nodes.candidates[nodes.heads], low)
    high = np.where(alone, nodes.candidates[nodes.heads + nodes.lengths - 1], high)
    differ = low ^ high
    divides = differ > 0
    bit = np.frexp(np.where(divides, differ, 1).astype(float))[1] - 1
    return (high >> bit) << bit, divides


@dataclass(frozen=True, eq=False)
class Division:
    """All children of some nodes, and those of them that the parents' multipliers leave open.

    Attributes:
        part: What is set apart in each parent.
        parent: Parent (c,) of each child.
        counts: Experiments (c,) in the part.
        children: Those children that a first look leaves.
        built: Which of all (k,) they are.
        of_children: Their parents (k,).
        sensitivities: Sensitivities of their candidates to their parents' multipliers.
    """

    part: Part
    parent: Indices
    counts: Indices
    children: Nodes
    built: Indices
    of_children: Indices
    sensitivities: Array

    @classmethod
    def of(cls, nodes: Nodes, part: Part, merits: Merits, Z: Array, least: float) -> "Division":
        """Divide nodes (b,) of multipliers (b, q), with regard to a merit that must be exceeded."""
        divided = np.zeros(len(nodes.heads), dtype=bool)
        divided[part.group] = True
        place = nodes.candidates
        inside = (place >= part.first[nodes.node_of]) & (place < part.stop[nodes.node_of])
        inside &= divided[nodes.group_of]
        outside = divided[nodes.group_of] & ~inside
        told = merits.tell(nodes, Z)
        z = told.sensitivities
        top = np.maximum.reduceat(np.where(inside, z, -np.inf), nodes.starts)
        rest = np.maximum.reduceat(np.where(outside, z, -np.inf), nodes.starts)
        whole = nodes.counts[part.group]
        parent = np.repeat(np.arange(nodes.n), whole + 1)
        counts = np.arange(len(parent)) - (np.cumsum(whole + 1) - whole - 1)[parent]
        others = whole[parent] - counts
        changed = told.merit - told.tops[part.group]
        merit = changed[parent] + _times(counts, top[parent]) + _times(others, rest[parent])
        built = np.flatnonzero(merit > least)
        # The part's candidates come first in its group.
        order = np.argsort(2 * nodes.group_of + outside, kind="stable")
        children, source = _built(
            nodes, order, inside[order], outside[order], parent[built], counts[built]
        )
        own = z[order][source]
        return cls(part, parent, counts, children, built, parent[built], own)

    def siblings(self, nodes: Nodes, some: Indices) -> tuple[Indices, Indices]:
        """Where some children (c,) of nodes stand in the line of their siblings.

        Returns:
            The side (c,), which is of one parent, and below its weight in the part or above; and
            how many of these are nearer to that (c,).
        """
        part, place = self.part, nodes.candidates
        inside = (place >= part.first[nodes.node_of]) & (place < part.stop[nodes.node_of])
        inside &= nodes.group_of == part.group[nodes.node_of]
        weight = np.bincount(nodes.node_of, nodes.weights * inside, nodes.n)[self.parent[some]]
        count = self.counts[some]
        side = 2 * self.parent[some] + (count > weight)
        order = np.lexsort((np.abs(count - weight), side))
        rank = np.empty(len(order), dtype=int)
        rank[order] = np.arange(len(order)) - np.searchsorted(side[order], side[order])
        return side, rank


def _times(counts: Indices, values: Array) -> Array:
    """Products, of which those with zero are zero."""
    return np.where(counts > 0, counts * np.where(counts > 0, values, 0.0), 0.0)


def _built(
    nodes: Nodes,
    order: Indices,
    inside: Mask,
    outside: Mask,
    parent: Indices,
    counts: Indices,
) -> tuple[Nodes, Indices]:
    """The children of parents (k,) with counts (k,) in their parts; where candidates are there."""
    sizes = nodes.sizes[parent]
    child = np.repeat(np.arange(len(parent)), sizes)
    source = np.arange(len(child)) + (nodes.starts[parent] - (np.cumsum(sizes) - sizes))[child]
    group = nodes.group_of[order][source]
    whole = nodes.counts[group]
    count = counts[child]
    experiments = np.where(inside[source], count, np.where(outside[source], whole - count, whole))
    some = np.flatnonzero(experiments > 0)
    source, child, group = source[some], child[some], group[some]
    # A group begins where the child, its parent's group, or the side of the division is another.
    side = outside[source]
    begins = (np.diff(child) != 0) | (np.diff(group) != 0) | (np.diff(side.astype(int)) != 0)
    heads = np.flatnonzero(np.append(np.ones(min(1, len(some)), dtype=bool), begins))
    number = np.where(inside[source], nodes.depths[parent][child] + 1, nodes.numbers[group])
    made = Nodes(
        candidates=nodes.candidates[order][source],
        weights=nodes.weights[order][source],
        heads=heads,
        counts=experiments[some][heads],
        numbers=number[heads],
        first_groups=np.searchsorted(child[heads], np.arange(len(parent))),
        depths=nodes.depths[parent] + 1,
    )
    return made, source

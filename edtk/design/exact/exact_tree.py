"""The tree of a proof that no plan of whole experiments is better, as flat arrays."""

from dataclasses import dataclass

import numpy as np

from edtk.design.exact.exact_nodes import Merits
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class ExactTree:
    """Why no plan of m experiments on n candidates costs less than a number: nodes and multipliers.

    *Merit.* A criterion of degree d has the merit ``cost^(-1/d)``, which is concave and grows as M
    does. A multiplier Z, positive semidefinite, bounds it: ``merit(X) <= <Z, X> / polar(Z)^(1/d)``
    for every information X, by `ConvexCriterion.polar`. The multipliers here are scaled so that the
    divisor is one, as far as rounding lets them be.

    *Parameters.* Multipliers are those of parameters k' with ``k = T k'``: the sensitivity of
    candidate i is ``z_i = <Z, T' M_i T>``, which of rows is the sum of the squares of
    ``A_i T B`` with ``B B' = Z``. What every plan has, ``K = size M0 + kept``, enters as
    ``<Z, T' K T>``. A criterion's polar of the parameters k is that of ``T Z T'``.

    *Nodes.* A node is a part of all plans. It divides some of the candidates into groups, and
    says of each group how many of the m experiments are made in it; candidates in no group are
    not measured. Node 0 has one group, number 0: all candidates, with m experiments. Every other
    node is its parent with one group divided in two: the candidates of group `group` whose position
    is from `first` to below `stop` become a new group, which gets `count` of the experiments; its
    number is the number of groups that the parent has ever had, so that a node at depth h has the
    groups 0 .. h. The other candidates of the group keep its number, and the rest of its
    experiments. All children of a node divide the same group at the same positions, and there is
    one for each count from zero to that of the group. A group of no experiments has no candidates
    any more.

    *Fixing.* In a node a plan of information X has ``<Z, X> <= u`` with
    ``u = <Z, T' K T> + sum over groups of count * (largest z of the group)``. A plan whose cost is
    below `target` has a merit above ``target^(-1/d)``. So where u is not above that, no plan of the
    node is better, and the node is closed. Else a candidate of a group is left out where
    ``u - (largest z of its group) + z_i`` is not above it. A node inherits what its parent left,
    divides it, leaves out by its parent's multiplier and then by its own: `multiplier` is the
    index of that, and equals the parent's where no other was needed. A node that is not closed, and
    whose groups have one candidate each, is one plan: what it costs can be computed, and is not
    below the target. Any other that has no children is open: its plans cost at least ``u^-d``, with
    the smallest u of its own multiplier and of those of its ancestors.

    With limits on how often each candidate is chosen, the largest sum of z of count experiments in
    the group takes the place of ``count * (largest z)``, and the least of these z that of the
    largest in fixing; a group that has fewer experiments to choose than its count closes the node.

    *Budgets.* Where the counts r of plans obey ``C r <= f``, each multiplier has prices ``mu >= 0``
    beside it: ``z_i - <mu, C_i>`` takes the place of z_i, and ``<Z, T' K T> + <mu, f>`` that of
    what every plan has, as ``<mu, f - C r>`` is not negative. Where places may stay empty, there is
    one candidate more, of the number n, that tells and costs nothing.

    A check needs the parents before their children, which the order of nodes grants, and two
    products of the candidates' rows a node. It may leave out less than was left out here: bounds
    have a margin of 1e-9 for that.

    Attributes:
        T: Regular matrix (p, p) of the parameters in which multipliers are written.
        order: Candidate (n,) at each position. Equal candidates stand for one another: only one of
            them has a position, unless there are limits on how often each is chosen.
        multipliers: Z (r, p, p), symmetric.
        prices: Prices (r, k) of budgets beside each.
        shares: By what shares (r, groups) each proves its bound, of a criterion that is the worst
            of several; None for any other.
        multiplier: Index of the multiplier of each node.
        parent: Parent of each node; -1 of the root.
        group: Number of the group that is divided; -1 of the root.
        first: Position at which the new group begins.
        stop: Position before which it ends.
        count: Number of experiments in the new group.
        target: No plan that the tree closes costs less [of the criterion].
    """

    T: Array
    order: Indices
    multipliers: Array
    prices: Array
    shares: Array | None
    multiplier: Indices
    parent: Indices
    group: Indices
    first: Indices
    stop: Indices
    count: Indices
    target: float

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(self.parent)


class TreeRecord:
    """A tree that grows, batch of nodes by batch of nodes."""

    def __init__(self) -> None:
        self._nodes: list[Indices] = []
        self._multipliers: list[Array] = []
        self._shares: list[Array] = []
        self.nodes = 0
        self.multipliers = 0

    def add_multipliers(self, packed: Array, shares: Array | None) -> Indices:
        """Keep multipliers (b, q + k) with their shares; their indices (b,)."""
        self._multipliers.append(packed)
        if shares is not None:
            self._shares.append(shares)
        self.multipliers += len(packed)
        return np.arange(self.multipliers - len(packed), self.multipliers)

    def add(
        self,
        parent: Indices,
        group: Indices,
        first: Indices,
        stop: Indices,
        count: Indices,
        multiplier: Indices,
    ) -> Indices:
        """Add nodes (b,), each described as `ExactTree` has it; their indices (b,)."""
        columns = np.array([parent, group, first, stop, count, multiplier])
        self._nodes.append(columns)
        self.nodes += columns.shape[1]
        return np.arange(self.nodes - columns.shape[1], self.nodes)

    def tree(
        self, T: Array, order: Indices, merits: Merits, unit: Array, target: float
    ) -> ExactTree:
        """The tree as it is; budgets are counted in units (k,)."""
        features = np.concatenate(self._multipliers)
        parent, group, first, stop, count, multiplier = np.concatenate(self._nodes, axis=1)
        return ExactTree(
            T=T,
            order=order,
            multipliers=merits.unpacked(features),
            prices=features[:, merits.q :] / unit,
            shares=np.concatenate(self._shares) if self._shares else None,
            multiplier=multiplier,
            parent=parent,
            group=group,
            first=first,
            stop=stop,
            count=count,
            target=target,
        )

"""Vertices of the points within linear constraints, and centroids of their faces."""

from dataclasses import dataclass

import numpy as np

from edtk.design.linear_constraints import LinearConstraints
from edtk.system.typing import Array, Mask

# Part of the size of a polytope's coordinates below which a distance is rounding.
NEAR_FACE = 1e-9
DIGITS = 12  # of coordinates in parts of the largest, that people write
ROUNDING = 1e-14  # of such a coordinate, by which it may differ from what people write


@dataclass(frozen=True, eq=False)
class Polytope:
    """All ``x = middle + basis z`` with ``G x <= h``: bounded, with room about its middle.

    Attributes:
        middle: A point (q,) inside.
        basis: Orthonormal directions (q, d) in which there is room.
        G: Inequalities (k, q), each of which some point obeys with room.
        h: Their right-hand sides (k,).
        E: Equations (l, q) that all points obey.
        e: Their right-hand sides (l,).
    """

    middle: Array
    basis: Array
    G: Array
    h: Array
    E: Array
    e: Array

    @classmethod
    def of(cls, rows: LinearConstraints, low: Array, high: Array) -> "Polytope":
        """The points between bounds (q,) that obey constraints; there is one at least."""
        from scipy.linalg import null_space

        G, h = _inequalities(rows, low, high)
        size = max(float(np.abs([low, high]).max()), 1e-300)
        room = _room(rows, G, h, low, high)
        is_equation = room <= NEAR_FACE * size * np.abs(G).sum(axis=1)
        E = G[is_equation]
        e = h[is_equation]
        basis = null_space(E) if len(E) else np.eye(len(low))
        G = G[~is_equation]
        h = h[~is_equation]
        # Constraints that no direction changes are obeyed by all points.
        varies = np.linalg.norm(G @ basis, axis=1) > NEAR_FACE * np.linalg.norm(G, axis=1)
        return cls(_middle(G[varies], h[varies], E, e), basis, G[varies], h[varies], E, e)

    def corners_and_centroids(self, most: int) -> Array:
        """The vertices (v, q), then the centroids of faces of dimension 1 to `most`, in turn."""
        corners = self._corners()
        active = self._active(corners)
        found = [corners]
        d = self.basis.shape[1]
        for dimension in range(1, min(most, d - 1) + 1):
            found.append(self._centroids(corners, active, dimension))
        if most >= d > 0:
            found.append(corners.mean(axis=0, keepdims=True))
        return _as_written(np.concatenate(found))

    def _corners(self) -> Array:
        """The vertices (v, q), the digits of a solver's rounding taken off."""
        d = self.basis.shape[1]
        if d == 0:
            return self._exact(self.middle[None])
        slope = self.G @ self.basis
        room = self.h - self.G @ self.middle
        if d == 1:
            steps = room / slope[:, 0]
            ends = np.array([steps[steps > 0].min(), steps[steps < 0].max()])
            return self._exact(self.middle + ends[:, None] * self.basis[:, 0])
        from scipy.spatial import HalfspaceIntersection

        spread = np.linalg.norm(slope, axis=1)
        faces = np.column_stack([slope, -room]) / spread[:, None]
        found = HalfspaceIntersection(faces, np.zeros(d)).intersections
        found = found[np.isfinite(found).all(axis=1)]
        return self._exact(self.middle + found @ self.basis.T)

    def _exact(self, points: Array) -> Array:
        """Points (v, q), each once, as solutions of the constraints on which they lie."""
        active = self._active(points)
        # A vertex is where its own set of constraints meet.
        _, first = np.unique(active, axis=0, return_index=True)
        found = np.empty((len(first), points.shape[1]))
        for row, point, on in zip(found, points[first], active[first], strict=True):
            A = np.vstack([self.E, self.G[on]])
            b = np.concatenate([self.e, self.h[on]])
            row[:] = point + np.linalg.lstsq(A, b - A @ point)[0]
        found = _as_written(found)
        return found[np.lexsort(found.T[::-1])[::-1]]

    def _active(self, points: Array) -> Mask:
        """Which inequalities (v, k) points lie on."""
        size = max(float(np.abs(points).max()), 1e-300)
        near = NEAR_FACE * size * np.abs(self.G).sum(axis=1)
        return np.asarray(self.h - points @ self.G.T <= near)

    def _centroids(self, corners: Array, active: Mask, dimension: int) -> Array:
        """Means (f, q) of the vertices of each face of a dimension.

        A face is a set of constraints and all vertices on them. Faces of a dimension less lie on
        one constraint more.
        """
        whole = np.ones(len(corners), dtype=bool)
        faces = {whole.tobytes(): whole}
        for _ in range(self.basis.shape[1] - dimension):
            smaller: dict[bytes, Mask] = {}
            for face in faces.values():
                parts = [face & active[:, k] for k in range(active.shape[1])]
                parts = [part for part in parts if part.any() and (part != face).any()]
                # Only the largest parts are faces of one dimension less.
                for part in parts:
                    inside = [other for other in parts if (part & ~other).sum() == 0]
                    if all((other == part).all() for other in inside):
                        smaller[part.tobytes()] = part
            faces = smaller
        means = np.array([corners[face].mean(axis=0) for face in faces.values()])
        return means[np.lexsort(means.T[::-1])[::-1]]


def _as_written(points: Array) -> Array:
    """Points (n, q) as people write them, where only rounding is between."""
    size = 10.0 ** np.ceil(np.log10(max(float(np.abs(points).max()), 1e-300)))
    rounded = np.round(points / size, DIGITS) * size
    return np.where(np.abs(points - rounded) <= ROUNDING * size, rounded, points) + 0.0


def _inequalities(rows: LinearConstraints, low: Array, high: Array) -> tuple[Array, Array]:
    """``G x <= h`` of bounds and constraints; an equation is two of them."""
    q = len(low)
    G = np.vstack([np.eye(q), -np.eye(q), rows.C, -rows.C])
    h = np.concatenate([high, -low, rows.high, -rows.low])
    finite = np.isfinite(h) & G.any(axis=1)
    return G[finite], h[finite]


def _room(rows: LinearConstraints, G: Array, h: Array, low: Array, high: Array) -> Array:
    """By how much (k,) a point can be away from each inequality."""
    best = [rows.best(-row, low, high) for row in G]
    return np.array(
        [np.inf if x is None else b - g @ x for g, b, x in zip(G, h, best, strict=True)]
    )


def _middle(G: Array, h: Array, E: Array, e: Array) -> Array:
    """The center (q,) of the largest ball inside (Chebyshev)."""
    from scipy.optimize import linprog

    q = G.shape[1]
    norms = np.linalg.norm(G, axis=1)
    found = linprog(
        np.append(np.zeros(q), -1.0),
        A_ub=np.column_stack([G, norms]) if len(G) else None,
        b_ub=h if len(G) else None,
        A_eq=np.column_stack([E, np.zeros(len(E))]) if len(E) else None,
        b_eq=e if len(E) else None,
        bounds=[(None, None)] * q + [(0, None if len(G) else 0)],
    )
    return np.asarray(found.x[:q])

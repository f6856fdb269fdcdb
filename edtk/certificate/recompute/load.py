"""The loads that a certificate allows."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.plain_data import number, numbers, rows, table
from edtk.system.typing import Array, Mask

KEYS = ("F_N", "T_Nm", "F_max_N", "direction", "list_F_N", "wrenches")
CHOICES = ("F_N", "F_max_N", "list_F_N", "wrenches")
MOST_LISTED = 1000  # loads to choose from
TINY = 1e-9  # of a load, beside the largest one, that is rounding


@dataclass(frozen=True, eq=False)
class Load:
    """A fixed wrench, one of a list, or any force up to a size, along a direction or anywhere.

    Attributes:
        listed: Wrenches (l, 6) of which each experiment takes one [N, N m]; a fixed load is a list
            of one. None for a force up to a size.
        fixed: Whether the list is a fixed load, which has no design variable.
        largest: Largest force [N].
        direction: Unit vector (3,) of the force; None if it may point anywhere.
    """

    listed: Array | None
    fixed: bool
    largest: float
    direction: Array | None

    @classmethod
    def from_dict(cls, load: Any) -> "Load":
        """Read the keys of a study's [load].

        Raises:
            ValueError: They do not say which loads are allowed.
        """
        where = "setting.load"
        load = table(load, (), where, KEYS)
        given = [key for key in CHOICES if key in load]
        if len(given) != 1:
            raise ValueError(f"{where}: expected one of F_N, F_max_N, list_F_N and wrenches")
        torque = numbers(load.get("T_Nm", [0, 0, 0]), (3,), f"{where}.T_Nm")
        if given != ["F_N"] and torque.any():
            raise ValueError(f"{where}: T_Nm goes with F_N only")
        if given != ["F_max_N"] and "direction" in load:
            raise ValueError(f"{where}: direction goes with F_max_N only")
        if given == ["F_N"]:
            force = numbers(load["F_N"], (3,), f"{where}.F_N")
            listed = np.concatenate([force, torque])[None]
            return cls(listed, True, 0.0, None)
        if given == ["list_F_N"]:
            rows(load["list_F_N"], MOST_LISTED, f"{where}.list_F_N")
            forces = numbers(load["list_F_N"], (None, 3), f"{where}.list_F_N")
            if not len(forces):
                raise ValueError(f"{where}.list_F_N: expected at least one force")
            return cls(np.hstack([forces, np.zeros_like(forces)]), False, 0.0, None)
        if given == ["wrenches"]:
            rows(load["wrenches"], MOST_LISTED, f"{where}.wrenches")
            wrenches = numbers(load["wrenches"], (None, 6), f"{where}.wrenches")
            if not len(wrenches):
                raise ValueError(f"{where}.wrenches: expected at least one")
            return cls(wrenches, False, 0.0, None)
        largest = number(load["F_max_N"], f"{where}.F_max_N")
        if largest <= 0:
            raise ValueError(f"{where}.F_max_N: expected a positive force")
        if "direction" not in load:
            return cls(None, False, largest, None)
        direction = numbers(load["direction"], (3,), f"{where}.direction")
        if not direction.any():
            raise ValueError(f"{where}.direction: expected a vector that is not zero")
        return cls(None, False, largest, direction / np.linalg.norm(direction))

    @property
    def size(self) -> int:
        """Number d of design variables: none, an index or a size, or a force in polar form."""
        if self.fixed:
            return 0
        return 3 if self.listed is None and self.direction is None else 1

    @property
    def moves(self) -> bool:
        """Whether a search may change the variables; an index does not change by steps."""
        return self.listed is None

    @property
    def limits(self) -> Array:
        """Bounds (2, d) of the variables."""
        if self.size == 3:
            return np.array([[-1.0, -np.pi, -2 * np.pi], [1.0, np.pi, 2 * np.pi]])
        last = 1.0 if self.listed is None else len(self.listed) - 1.0
        return np.array([[0.0] * self.size, [last] * self.size])

    def draw(self, cube: Array) -> Array:
        """Variables (k, d) of points of the unit cube (k, d)."""
        if self.fixed or self.direction is not None:
            return cube
        if self.listed is not None:
            last = len(self.listed) - 1
            return np.minimum(np.floor(len(self.listed) * cube), last)
        # Uniform in the ball: its volume grows with the cube of the size, its area with the sine.
        elevation = np.arcsin(np.clip(2 * cube[:, 1] - 1, -1.0, 1.0))
        azimuth = np.pi * (2 * cube[:, 2] - 1)
        return np.stack([np.cbrt(cube[:, 0]), elevation, azimuth], axis=1)

    def allows(self, u: Array) -> Mask:
        """Which variables (k, d) are within their bounds; an index must be whole too."""
        lower, upper = self.limits
        inside = ((u >= lower - TINY) & (u <= upper + TINY)).all(axis=1)
        return np.asarray(inside if self.moves else inside & (u == np.rint(u)).all(axis=1))

    def wrench(self, u: Array) -> Array:
        """Wrenches (k, 6) [N, N m] of variables (k, d)."""
        if self.listed is not None:
            index = np.zeros(len(u), dtype=int) if self.fixed else np.rint(u[:, 0]).astype(int)
            return self.listed[index]
        found = np.zeros((len(u), 6))
        if self.direction is not None:
            found[:, :3] = u * self.largest * self.direction
            return found
        r, elevation, azimuth = u.T
        flat = np.cos(elevation)
        force = [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]
        found[:, :3] = self.largest * (r * np.stack(force)).T
        return found

    def excess(self, wrench: Array) -> Array:
        """How far wrenches (k, 6) are from what is allowed, relative to the largest one (k,)."""
        if self.listed is not None:
            away = np.full(len(wrench), np.inf)
            for one in self.listed:
                away = np.minimum(away, np.abs(wrench - one).max(axis=1))
            return away / max(float(np.abs(self.listed).max()), np.finfo(float).tiny)
        force = wrench[:, :3]
        size = np.linalg.norm(force, axis=1)
        away = np.maximum(size - self.largest, np.abs(wrench[:, 3:]).max(axis=1))
        if self.direction is not None:
            along = force @ self.direction
            aside = np.linalg.norm(force - along[:, None] * self.direction, axis=1)
            away = np.maximum(away, np.maximum(-along, aside))
        return np.asarray(np.maximum(away, 0.0) / self.largest)

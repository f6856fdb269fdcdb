"""All tasks of a robot together: the poses in which it shall be accurate."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from edtk.model.rigid_joints import RigidJoint
from edtk.model.task import Task
from edtk.system.typing import Array


class Tasks(tuple[Task, ...]):
    """Tasks in their order, of which each counts by its weight.

    Where a number stands for all of them it is the root of the weighted mean of squares; one task
    alone gives its own numbers, to the last bit. A task of weight zero is looked at, but nothing is
    designed for it.
    """

    @cached_property
    def shares(self) -> Array:
        """The weights (t,), divided by their sum."""
        weights = np.array([task.weight for task in self])
        return np.asarray(weights / weights.sum())

    @cached_property
    def target(self) -> Array:
        """The target (r, p) of rho0: ``|target dk|^2`` is the mean harm of dk [m/(rad/(N m))].

        The target of a single task is its own, and otherwise a triangle R of at most p rows with
        ``R'R = sum_i w_i A_i' A_i / sum_i w_i`` for the targets A_i.
        """
        if len(self) == 1:
            return self[0].target
        # From the stacked rows: their squares would lose half of the digits.
        return np.asarray(np.linalg.qr(self._weighted([task.target for task in self]), mode="r"))

    @cached_property
    def targets(self) -> Array:
        """The target of each task (t, r, p), padded with rows of zeros to one shape.

        That of a task without weight is zero: it is no part of the worst.
        """
        each = [task.target for task in self]
        padded = np.zeros((len(self), max(map(len, each)), each[0].shape[-1]))
        for place, target, task in zip(padded, each, self, strict=True):
            if task.weight:
                place[: len(target)] = target
        return padded

    @cached_property
    def regressor(self) -> Array:
        """Rows (r, p) whose squares, times dk, are the mean squared displacement of the tool point.

        Those of a single task are A0 (3, p), Eq. (4) [m/(rad/(N m))].
        """
        if len(self) == 1:
            return self[0].regressor
        return self._weighted([task.regressor for task in self])

    @property
    def place(self) -> str:
        """Where rho0 is the error, in words."""
        if len(self) == 1:
            return self[0].place
        sizes = {task.within for task in self}
        if len(sizes) > 1:
            return f"in {len(self)} test poses and around them"
        around = f"within {np.rad2deg(max(sizes)):.3g} deg of {len(self)} test poses"
        return around if max(sizes) else f"in {len(self)} test poses"

    @cached_property
    def rigid_joints(self) -> tuple[RigidJoint, ...]:
        """Joints that count as rigid although a load turns them, where that does most."""
        most: dict[str, RigidJoint] = {}
        for joint in (joint for task in self for joint in task.rigid_joints):
            if joint.name not in most or joint.displacement > most[joint.name].displacement:
                most[joint.name] = joint
        names = self[0].robot.joint_names
        return tuple(sorted(most.values(), key=lambda joint: names.index(joint.name)))

    def with_unknown(self, unknown: tuple[int, ...]) -> "Tasks":
        """The same tasks of a robot of which other compliances are unknown."""
        return Tasks(replace(task, unknown=unknown) for task in self)

    def _weighted(self, each: Sequence[Array]) -> Array:
        """Rows (..., p) of each task, times the root of its share, below each other."""
        return np.concatenate(
            [np.sqrt(share) * rows for share, rows in zip(self.shares, each, strict=True) if share]
        )

"""Compliances as an identification writes them: JSON, by joint, perhaps with a covariance."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from edtk.measure.expected_error import AssumedError, AssumedJoint
from edtk.system.arguments import is_number
from edtk.system.errors import UserError
from edtk.system.files import read_text
from edtk.system.parsing import parse_json
from edtk.system.typing import Array

# Compliance, standard deviation or error; no robot comes near it in SI units.
LARGEST_COMPLIANCE = 1e3
LARGEST_SQUARE = LARGEST_COMPLIANCE**2  # entry of a covariance
# Degrees of freedom: a robust fit may leave less than one; beyond the most, sigma is known.
LEAST_DOF = 0.5
MOST_DOF = 1e9
# Differences and negative eigenvalues up to these count as the rounding of a matrix in a file,
# relative to its largest entry and to unit diagonal.
SYMMETRY = 1e-9
UNIT_DIAGONAL = 1e-6
LEAST_EIGENVALUE = -1e-8


@dataclass(frozen=True, eq=False)
class Compliances:
    """Compliances of some joints.

    Attributes:
        joints: Names (p,) of the joints.
        k: Their compliances (p,) [rad/(N m)].
        unbounded: Their values without the bound k >= 0 (p,); k itself where the file does not say.
        covariance: Covariance (p, p) of `unbounded` [(rad/(N m))^2]; None where the file does not
            give it.
        covariance_dof: Its degrees of freedom; inf where sigma was known.
        rho0_bias: Error that the linear model left in the test pose [m]; None where the file does
            not say.
        bias: By how far the linear model made them too large (p,); None where the file does not
            say.
        verdict: "good", "usable" or "bad", as the identification called itself; None where the file
            does not say.
        measured: Covariance (p, p) by all that was measured; None where the file does not say.
        assumed: The joints (a,) that were not identified, and what their errors do.
        every: Covariance (p + a, p + a) of all of them by all that is uncertain; None likewise.
        compensators: Digest of those of the robot, empty without any; None where the file does not
            say.
        possible: What errors of the model leave possible, as a calibration writes it; None
            likewise.
        where: The file that they are from, for messages.
    """

    joints: tuple[str, ...]
    k: Array
    unbounded: Array
    covariance: Array | None
    covariance_dof: float = np.inf
    rho0_bias: float | None = None
    verdict: str | None = None
    bias: Array | None = None
    measured: Array | None = None
    assumed: tuple[AssumedError, ...] = ()
    every: Array | None = None
    compensators: str | None = None
    possible: Mapping[str, Any] | None = None
    where: Path | str | None = "compliances"

    def including(self, joints: Sequence[AssumedJoint]) -> "Compliances":
        """The same with the joints that are not identified, and with all that is uncertain.

        An error of such a joint by a standard deviation moves the estimates e by the shifts s that
        the calibration has told, so that the covariance of all is
        ``C_measured + sum_j (s_j, -std_j) (s_j, -std_j)'``.

        Args:
            joints: The joints that are not identified; those that have a compliance here count as
                identified.
        """
        more = [self._assumed_of(one) for one in joints if one.name not in self.joints]
        wider = (0, len(more))
        covariance = None
        if self.covariance is not None:
            own = self.covariance if self.measured is None else self.measured
            errors = np.array([np.append(one.shifts, np.zeros(len(more))) for one in more])
            errors = errors.reshape(len(more), len(self.joints) + len(more))
            errors[range(len(more)), range(len(self.joints), errors.shape[1])] = [
                -one.joint.std for one in more
            ]
            covariance = np.pad(own, wider) + errors.T @ errors
            if more and more == list(self.assumed) and self.every is not None:
                covariance = self.every
        added = [one.joint.compliance for one in more]
        return replace(
            self,
            joints=(*self.joints, *(one.joint.name for one in more)),
            k=np.append(self.k, added),
            unbounded=np.append(self.unbounded, added),
            covariance=covariance,
            measured=None,
            every=None,
            assumed=tuple(more),
            bias=None if self.bias is None else np.pad(self.bias, wider),
        )

    def _assumed_of(self, joint: AssumedJoint) -> AssumedError:
        """What the calibration has assumed of a joint; a known one as it was measured, too."""
        for one in self.assumed:
            if one.joint.name == joint.name and one.joint.rigid == joint.rigid:
                return one
        return AssumedError(joint, np.zeros(len(self.joints)))

    @classmethod
    def from_dict(
        cls,
        content: Mapping[str, Any],
        names: tuple[str, ...],
        needed: tuple[str, ...],
        where: Path | str | None = None,
    ) -> "Compliances":
        """Take compliances from the content of a file, see `load_compliances`.

        Args:
            content: ``{"k": {joint: value}, ...}`` or ``{joint: value}``, in SI units.
            names: Joints of the robot.
            needed: Joints whose compliances must be given.
            where: The file, for messages.

        Raises:
            UserError: One line: the file, the key and what was expected.
        """
        # A joint may be called k: then its own compliance is a number.
        nested = "k" in content and ("k" not in names or isinstance(content["k"], Mapping))
        table = content["k"] if nested else content
        rest = content if nested else {}
        if not isinstance(table, Mapping):
            raise UserError(
                "expected a value in rad/(N m) for each joint, by name", where=where, key="k"
            )
        prefix = "k." if nested else ""
        _check_joints(table, names, needed, prefix, where)
        joints = tuple(table)
        k = np.array([_not_negative(table[joint], f"{prefix}{joint}", where) for joint in joints])
        unbounded = _by_joint(rest, "k_unbounded", joints, where)
        assumed = _assumed(rest, names, joints, where)
        robot = rest.get("prediction")
        return cls(
            joints=joints,
            k=k,
            unbounded=k if unbounded is None else unbounded,
            covariance=_covariance(rest, joints, where),
            covariance_dof=_degrees_of_freedom(rest.get("covariance_dof"), where),
            rho0_bias=_optional(rest.get("rho0_bias"), "rho0_bias", where),
            verdict=rest.get("verdict"),
            bias=_by_joint(rest, "k_bias", joints, where),
            measured=_measured(rest, joints, where),
            assumed=assumed,
            every=_measured(rest, joints, where, "covariance_all", len(assumed)),
            compensators=str(robot.get("compensators", "")) if isinstance(robot, dict) else None,
            possible=_table(rest, "possible_springs", where),
            where=where,
        )


def load_compliances(
    path: Path | str, names: tuple[str, ...], needed: tuple[str, ...]
) -> Compliances:
    """Read compliances from a file.

    ``{"k": {joint: value}}``, with ``"covariance": [[..]]``, or with ``"std"`` and perhaps
    ``"correlation"``, or with neither. Matrices and lists follow the order of the joints in "k";
    "std" may also be given by joint, and without "correlation" the errors count as independent. A
    file that is just ``{joint: value}`` is read too. Where sigma was estimated, "covariance_dof"
    are its degrees of freedom; "k_bias" is by how far the linear model made k too large, by joint.
    Other keys are ignored.

    Args:
        path: The file, in SI units.
        names: Joints of the robot.
        needed: Joints whose compliances must be given.

    Raises:
        UserError: One line: the file, the key and what was expected.
    """
    return Compliances.from_dict(compliances_file(path), names, needed, path)


def compliances_file(path: Path | str) -> Mapping[str, Any]:
    """The content of a file of compliances.

    Raises:
        UserError: It is no JSON object.
    """
    path = Path(path)
    content = parse_json(read_text(path), path)
    if not isinstance(content, dict):
        raise UserError(
            f'expected {{"k": {{joint: value, ...}}}}, not {type(content).__name__}', where=path
        )
    return content


def _check_joints(
    table: Mapping[str, Any],
    names: tuple[str, ...],
    needed: tuple[str, ...],
    prefix: str,
    where: Path | str | None,
) -> None:
    """Every joint of the table is one of the robot's, and those that are needed have a value."""
    for joint in table:
        if joint not in names:
            raise UserError(
                f"no such joint; this robot has {', '.join(names)}",
                where=where,
                key=f"{prefix}{joint}",
            )
    missing = [joint for joint in needed if joint not in table]
    if missing:
        listed = ", ".join(map(repr, missing))
        of = f"joint{'s' * (len(missing) > 1)} {listed}"
        raise UserError(
            f"expected the compliance of {of} in rad/(N m), which the study asks for. Where no "
            "reading tells it, remove the joint from joints.unknown, and give what is known of it "
            "in joints.known_rad_per_Nm",
            where=where,
            key=f"{prefix}{missing[0]}",
        )


def _table(
    content: Mapping[str, Any], key: str, where: Path | str | None
) -> Mapping[str, Any] | None:
    """A table; None where the file gives none."""
    value = content.get(key)
    if value is not None and not isinstance(value, Mapping):
        raise UserError("expected a table", where=where, key=key)
    return value


def _by_joint(
    content: Mapping[str, Any], key: str, joints: tuple[str, ...], where: Path | str | None
) -> Array | None:
    """Finite numbers (p,) by joint, of any sign; None where the file does not give them."""
    value = content.get(key)
    if value is None:
        return None
    numbers = [value.get(joint) if isinstance(value, Mapping) else None for joint in joints]
    for joint, number in zip(joints, numbers, strict=True):
        if not is_number(number) or not abs(number) <= LARGEST_COMPLIANCE:
            message = f"expected a number from {-LARGEST_COMPLIANCE:g} to {LARGEST_COMPLIANCE:g}"
            raise UserError(message, where=where, key=f"{key}.{joint}")
    return np.array(numbers, dtype=float)


def _measured(
    content: Mapping[str, Any],
    joints: tuple[str, ...],
    where: Path | str | None,
    key: str = "covariance_measured",
    more: int = 0,
) -> Array | None:
    """A covariance (p + more, p + more) of what is uncertain; None where the file gives none."""
    if content.get(key) is None:
        return None
    return _valid(_matrix(content[key], len(joints) + more, key, where), key, where)


def _assumed(
    content: Mapping[str, Any],
    names: tuple[str, ...],
    joints: tuple[str, ...],
    where: Path | str | None,
) -> tuple[AssumedError, ...]:
    """The joints that were not identified; none where the file does not say."""
    key = "assumed_joints"
    given = content.get(key)
    if given is None:
        return ()
    if not isinstance(given, list) or not all(isinstance(one, Mapping) for one in given):
        raise UserError("expected a list of objects, one a joint", where=where, key=key)
    found = []
    for i, one in enumerate(given):
        place = f"{key}.{i}"
        name = one.get("joint")
        if name not in names or name in joints:
            message = "expected a joint of this robot that is not in k"
            raise UserError(message, where=where, key=f"{place}.joint")
        taken = _not_negative(one.get("rad_per_Nm"), f"{place}.rad_per_Nm", where)
        std = _not_negative(one.get("std_rad_per_Nm"), f"{place}.std_rad_per_Nm", where)
        shifts = _by_joint(one, "shifts_rad_per_Nm", joints, where)
        source = one.get("source")
        words = source if isinstance(source, str) else "stated in the file"
        joint = AssumedJoint(name, names.index(name), taken, std, words)
        found.append(AssumedError(joint, np.zeros(len(joints)) if shifts is None else shifts))
    return tuple(found)


def _degrees_of_freedom(value: Any, where: Path | str | None) -> float:
    """A number of a sensible size; without it sigma was known, which is inf."""
    if value is None:
        return np.inf
    if not is_number(value) or not LEAST_DOF <= value <= MOST_DOF:
        message = f"expected a number from {LEAST_DOF:g} to {MOST_DOF:g}, or null for known sigma"
        raise UserError(message, where=where, key="covariance_dof")
    return float(value)


def _optional(value: Any, key: str, where: Path | str | None) -> float | None:
    """Such a number, or None."""
    return None if value is None else _not_negative(value, key, where)


def _not_negative(value: Any, key: str, where: Path | str | None) -> float:
    """A number of a sensible size that is not negative."""
    if not is_number(value) or not 0 <= value <= LARGEST_COMPLIANCE:
        given = f"{json.dumps(value, default=str):.40}"
        raise UserError(
            f"expected a number from 0 to {LARGEST_COMPLIANCE:g}, got {given}", where=where, key=key
        )
    return float(value)


def _covariance(
    content: Mapping[str, Any], joints: tuple[str, ...], where: Path | str | None
) -> Array | None:
    """The covariance (p, p) in the order of the joints, whichever way it is given."""
    if content.get("covariance") is not None:
        key = "covariance"
        cov = _matrix(content[key], len(joints), key, where)
    elif content.get("std") is not None:
        key = "correlation"
        cov = _of_deviations(content["std"], content.get(key), joints, where)
    else:
        return None
    return _valid(cov, key, where)


def _valid(cov: Array, key: str, where: Path | str | None) -> Array:
    """A symmetric matrix (p, p) that is a covariance."""
    deviations = np.sqrt(np.maximum(np.diag(cov), 0.0))
    # Scaled to unit diagonal, so that small compliances beside large ones are checked too.
    scale = np.where(deviations > 0, deviations, 1.0)
    unit = cov / scale / scale[:, None]
    negative = np.diag(cov).min() < 0 or np.linalg.eigvalsh(unit).min() < LEAST_EIGENVALUE
    if negative or np.any(cov[deviations == 0] != 0):
        raise UserError(
            "expected a covariance, and this matrix has a negative eigenvalue", where=where, key=key
        )
    return cov


def _of_deviations(
    std: Any, correlation: Any, joints: tuple[str, ...], where: Path | str | None
) -> Array:
    """The covariance (p, p) of standard deviations, given by joint or as a list."""
    p = len(joints)
    if isinstance(std, Mapping):
        missing = [joint for joint in joints if joint not in std]
        if missing:
            raise UserError(
                "expected a standard deviation, as k has that joint",
                where=where,
                key=f"std.{missing[0]}",
            )
        std = [std[joint] for joint in joints]
    if not isinstance(std, list) or len(std) != p:
        raise UserError(
            f"expected {p} standard deviations, one for each joint of k", where=where, key="std"
        )
    given = zip(joints, std, strict=True)
    s = np.array([_not_negative(value, f"std.{joint}", where) for joint, value in given])
    R = np.eye(p) if correlation is None else _matrix(correlation, p, "correlation", where)
    if not np.allclose(np.diag(R), 1.0, atol=UNIT_DIAGONAL):
        raise UserError("expected ones on the diagonal", where=where, key="correlation")
    return np.asarray(R * s[:, None] * s)


def _matrix(value: Any, p: int, key: str, where: Path | str | None) -> Array:
    """A symmetric matrix (p, p)."""
    expected = f"expected {p} rows of {p} numbers up to {LARGEST_SQUARE:g}, in the order of k"
    try:
        matrix = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise UserError(expected, where=where, key=key) from error
    if matrix.shape != (p, p) or not (np.abs(matrix) <= LARGEST_SQUARE).all():
        raise UserError(expected, where=where, key=key)
    unequal = np.abs(matrix - matrix.T) > SYMMETRY * np.abs(matrix).max(initial=0.0)
    if unequal.any():
        row, column = np.argwhere(unequal)[0] + 1
        raise UserError(
            f"row {row}, column {column}: differs from row {column}, column {row}",
            where=where,
            key=key,
        )
    return np.asarray((matrix + matrix.T) / 2)

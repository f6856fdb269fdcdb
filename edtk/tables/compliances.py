"""Compliances as an identification writes them: JSON, values by joint, perhaps with their covariance."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from edtk.system.errors import UserError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Compliances:
    """Compliances of some joints.

    Attributes:
        joints: Names (p,) of the joints.
        k: Their compliances (p,) [rad/(N m)].
        unbounded: What they would be without the bound k >= 0 (p,); k itself where the file does not say.
        covariance: Covariance (p, p) of `unbounded` [(rad/(N m))^2]; None where the file says nothing about it.
        covariance_dof: Its degrees of freedom; inf where sigma was known.
        rho0_bias: Error that the linear model left in the test pose [m]; None where the file does not say.
        verdict: "good", "warn" or "bad", as the identification judged itself; None where the file does not say.
    """

    joints: tuple[str, ...]
    k: Array
    unbounded: Array
    covariance: Array | None
    covariance_dof: float = np.inf
    rho0_bias: float | None = None
    verdict: str | None = None


def load_compliances(
    path: Path | str, names: tuple[str, ...], needed: tuple[str, ...]
) -> Compliances:
    """Read ``{"k": {joint: value}}``, with ``"covariance": [[..]]`` or ``"std"`` and ``"correlation"``, or nothing.

    Matrices and lists follow the order of the joints in "k"; "std" may also be given by joint, and without
    "correlation" the errors count as independent. A file that is just ``{joint: value}`` is read too. Where
    sigma was estimated, "covariance_dof" are its degrees of freedom. Other keys are left alone.

    Args:
        path: The file, in SI units.
        names: Joints of the robot.
        needed: Joints whose compliances must be there.

    Raises:
        UserError: One line: the file, the key and what was expected.
    """
    path = Path(path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: not valid JSON: {error}") from error
    if not isinstance(content, dict):
        raise UserError(
            f'{path}: expected {{"k": {{joint: value, ...}}}}, not {type(content).__name__}'
        )
    nested = "k" in content and "k" not in names
    table, rest = (content["k"], content) if nested else (content, {})
    if not isinstance(table, dict):
        raise UserError(f"{path}: k: expected a value in rad/(N m) for each joint, by name")
    where = "k." if nested else ""
    for joint in table:
        if joint not in names:
            raise UserError(
                f"{path}: {where}{joint}: no such joint; this robot has {', '.join(names)}"
            )
    for joint in needed:
        if joint not in table:
            raise UserError(
                f"{path}: {where}{joint}: expected the compliance of joint {joint!r} in rad/(N m)"
            )
    joints = tuple(table)
    k = np.array([_not_negative(path, f"{where}{joint}", table[joint]) for joint in joints])
    dof, rho0_bias = rest.get("covariance_dof"), rest.get("rho0_bias")
    dof = np.inf if dof is None else _not_negative(path, "covariance_dof", dof)
    if not dof:
        raise UserError(f"{path}: covariance_dof: expected more than none")
    rho0_bias = None if rho0_bias is None else _not_negative(path, "rho0_bias", rho0_bias)
    unbounded = (
        k if rest.get("k_unbounded") is None else _unbounded(path, rest["k_unbounded"], joints)
    )
    return Compliances(
        joints, k, unbounded, _covariance(path, rest, joints), dof, rho0_bias, rest.get("verdict")
    )


def _unbounded(path: Path, value: Any, joints: tuple[str, ...]) -> Array:
    """Finite numbers (p,) by joint."""
    numbers = [value.get(joint) if isinstance(value, dict) else None for joint in joints]
    for joint, x in zip(joints, numbers, strict=True):
        if not isinstance(x, int | float) or isinstance(x, bool) or not abs(x) <= 1e300:
            raise UserError(f"{path}: k_unbounded.{joint}: expected a finite number")
    return np.array(numbers, dtype=float)


def _not_negative(path: Path, key: str, value: Any) -> float:
    """A finite number that is not negative."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not 0 <= value <= 1e300:
        raise UserError(
            f"{path}: {key}: expected a finite number that is not negative, got {json.dumps(value):.40}"
        )
    return float(value)


def _matrix(path: Path, key: str, value: Any, p: int) -> Array:
    """A finite symmetric matrix (p, p)."""
    expected = f"{path}: {key}: expected {p} rows of {p} finite numbers, in the order of k"
    try:
        matrix = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise UserError(expected) from error
    if matrix.shape != (p, p) or not np.isfinite(matrix).all():
        raise UserError(expected)
    unlike = np.abs(matrix - matrix.T) > 1e-9 * np.abs(matrix).max(initial=0.0)
    if unlike.any():
        row, column = np.argwhere(unlike)[0] + 1
        raise UserError(
            f"{path}: {key}: row {row}, column {column}: differs from row {column}, column {row}"
        )
    return np.asarray((matrix + matrix.T) / 2)


def _covariance(path: Path, content: dict[str, Any], joints: tuple[str, ...]) -> Array | None:
    """The covariance in the order of the joints, whichever way it is given."""
    p = len(joints)
    if content.get("covariance") is not None:
        key, cov = "covariance", _matrix(path, "covariance", content["covariance"], p)
    elif content.get("std") is not None:
        std = content["std"]
        if isinstance(std, dict):
            if missing := [joint for joint in joints if joint not in std]:
                raise UserError(
                    f"{path}: std.{missing[0]}: expected a standard deviation, as k has that joint"
                )
            std = [std[joint] for joint in joints]
        if not isinstance(std, list) or len(std) != p:
            raise UserError(
                f"{path}: std: expected {p} standard deviations, one for each joint of k"
            )
        s = np.array(
            [
                _not_negative(path, f"std.{joint}", value)
                for joint, value in zip(joints, std, strict=True)
            ]
        )
        key, given = "correlation", content.get("correlation")
        R = np.eye(p) if given is None else _matrix(path, "correlation", given, p)
        if not np.allclose(np.diag(R), 1.0, atol=1e-6):
            raise UserError(f"{path}: correlation: expected ones on the diagonal")
        cov = R * s[:, None] * s
    else:
        return None
    scale = np.sqrt(np.maximum(np.diag(cov), 0.0))
    unit = cov / np.where(scale > 0, scale, 1.0) / np.where(scale > 0, scale, 1.0)[:, None]
    if (
        np.diag(cov).min() < 0
        or np.linalg.eigvalsh(unit).min() < -1e-8
        or np.any(cov[scale == 0] != 0)
    ):
        raise UserError(
            f"{path}: {key}: expected a covariance, and this matrix has a negative eigenvalue"
        )
    return cov

"""A fitted geometry as plain numbers, and back."""

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from criteria.linalg.is_semidefinite import is_semidefinite
from edtk.calibration.geometry.counting import Counting
from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.inference.geometry.fit_variances_of_blocks import BlockVariances
from edtk.inference.geometry.fitted_geometry import FittedGeometry
from edtk.inference.geometry.position_noise import PositionNoise
from edtk.model.geometry.geometric_parameter import GeometricParameter
from edtk.model.robot import Robot
from edtk.system.typing import Array

MOST = 1000  # parameters or joints in a file
LARGEST = 1e9  # number in a file, in any of its units: squares of larger ones lose all meaning
RIGID = 1e-9
ROUNDING = 1e-8  # of a covariance's entries, beside the standard deviations


def geometry_to_dict(fitted: FittedGeometry, counting: Counting) -> dict[str, Any]:
    """All that a prediction needs, besides the study.

    Lengths are in metres, parameters in their own units (mm, mrad, 1e-6 rad/(N m)).
    """
    noise = fitted.noise
    found = noise.model_fit
    return {
        "robot": _digest(fitted.model.robot),
        "markers": list(fitted.model.markers),
        "base": fitted.model.start.tolist(),
        "offsets_m": np.asarray(fitted.model.offsets).tolist(),
        "placed_m": fitted.placed.tolist(),
        **(
            {}
            if fitted.placed_turns is None
            else {"placed_turns_rad": fitted.placed_turns.tolist()}
        ),
        "names": [one.name for one in fitted.model.parameters],
        "values": fitted.values.tolist(),
        "covariance": fitted.covariance.tolist(),
        "open": [one.name for one in fitted.open_parameters],
        "shares": fitted.shares.tolist(),
        "counting": counting.matrix.tolist(),
        "counting_words": counting.words,
        "noise": {
            "reading_mm": noise.reading,
            "joints_mrad": np.asarray(noise.joints).tolist(),
            "model_white_mm": noise.model_white,
            "model_joints_mrad": np.asarray(noise.model_joints).tolist(),
            "variances": [] if found is None else found.variances.tolist(),
            "variances_covariance": [] if found is None else found.covariance.tolist(),
            "repeats": noise.repeats,
            **(
                {}
                if noise.turn is None
                else {"turn_mrad": noise.turn, "model_turn_mrad": noise.model_turn}
            ),
        },
    }


def geometry_of_dict(
    given: Mapping[str, Any], setting: StudyGeometry
) -> tuple[FittedGeometry, Counting]:
    """The fitted geometry of a result.

    Args:
        given: The table `geometry` of a result.
        setting: The study that it is of.

    Raises:
        ValueError: It is none of this study; the message says what is wrong.
    """
    model = setting.model
    if given.get("robot") != _digest(model.robot):
        raise ValueError("robot: the result is of another robot or tool than the study's")
    every = {one.name: one for one in model.parameters}
    kept = _named(given, "names", every)
    opened = _named(given, "open", every)
    if len({one.name for one in (*kept, *opened)}) < len(kept) + len(opened):
        raise ValueError("names: expected each once, in names or in open")
    n = model.robot.n
    p = len(kept)
    values = _numbers(given, "values", (p,))
    fitted_model = model.with_parameters(tuple(kept))
    fitted_model = replace(
        fitted_model,
        start=_pose(given, "base"),
        offsets=_numbers(given, "offsets_m", (len(model.markers), 3)),
    )
    if given.get("markers") != list(model.markers):
        raise ValueError(f"markers: expected {', '.join(model.markers)}, those of the study")
    fitted = FittedGeometry(
        fitted_model,
        values * fitted_model.scales,
        _covariance(given, "covariance", p),
        tuple(opened),
        _numbers(given, "shares", (p, len(opened))),
        _noise(given.get("noise"), n, setting.full_poses),
        _numbers(given, "placed_m", (len(model.markers), 3)),
        # Results of full poses that are older do not have them; commands ask for them.
        _numbers(given, "placed_turns_rad", (len(model.markers), 3))
        if "placed_turns_rad" in given and setting.full_poses
        else None,
    )
    words = given.get("counting_words", "")
    return fitted, Counting(_numbers(given, "counting", (n, n)), str(words))


def _digest(robot: Robot) -> str:
    """A name of the drawing: hex digits that differ where a length or an axis does."""
    numbers = [robot.base, robot.tool, *(joint.origin for joint in robot.chain)]
    text = " ".join(f"{x:.9f}" for T in numbers for x in np.ravel(T) + 0.0)
    text += " ".join(f"{joint.name} {joint.kind} {joint.axis.tolist()}" for joint in robot.chain)
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:12]


def _named(
    given: Mapping[str, Any], key: str, every: Mapping[str, GeometricParameter]
) -> list[GeometricParameter]:
    """Parameters by their names.

    Raises:
        ValueError: A name is not that of a parameter of the study.
    """
    names = given.get(key)
    if not isinstance(names, list) or len(names) > MOST:
        raise ValueError(f"{key}: expected a list of names")
    for name in names:
        if not isinstance(name, str) or name not in every:
            raise ValueError(f"{key}: the study has no parameter {name!r}")
    return [every[name] for name in names]


def _noise(given: object, n: int, full_poses: bool) -> PositionNoise:
    """The noise.

    Raises:
        ValueError: A number is missing.
    """
    if not isinstance(given, Mapping):
        raise ValueError("noise: expected a table")
    found = None
    variances = given.get("variances")
    if not isinstance(variances, list) or len(variances) > MOST:
        raise ValueError("variances: expected a list of numbers")
    if variances:
        c = len(variances)
        found = BlockVariances(
            _not_negative(given, "variances", (c,)),
            _covariance(given, "variances_covariance", c),
            float("nan"),
        )
    return PositionNoise(
        float(_not_negative(given, "reading_mm", ())),
        _not_negative(given, "joints_mrad", (n,)),
        float(_not_negative(given, "model_white_mm", ())),
        _not_negative(given, "model_joints_mrad", (n,)),
        found,
        int(_not_negative(given, "repeats", ())),
        float(_not_negative(given, "turn_mrad", ())) if full_poses else None,
        float(_not_negative(given, "model_turn_mrad", ())) if full_poses else 0.0,
    )


def _numbers(given: Mapping[str, Any], key: str, shape: tuple[int, ...]) -> Array:
    """Finite numbers of a shape.

    Raises:
        ValueError: The key has others.
    """
    try:
        values = np.array(given.get(key), dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{key}: expected numbers") from None
    values = values.reshape(shape) if not values.size and 0 in shape else values
    if values.shape != shape or not np.isfinite(values).all():
        size = " by ".join(map(str, shape)) or "one"
        raise ValueError(f"{key}: expected {size} finite numbers")
    if (np.abs(values) > LARGEST).any():
        raise ValueError(f"{key}: expected numbers up to {LARGEST:g}")
    return values


def _not_negative(given: Mapping[str, Any], key: str, shape: tuple[int, ...]) -> Array:
    """Numbers of a shape, none below zero.

    Raises:
        ValueError: The key has others.
    """
    values = _numbers(given, key, shape)
    if (values < 0).any():
        raise ValueError(f"{key}: expected numbers that are not negative")
    return values


def _covariance(given: Mapping[str, Any], key: str, order: int) -> Array:
    """A covariance (order, order).

    Raises:
        ValueError: The key has other numbers.
    """
    values = _numbers(given, key, (order, order))
    size = np.sqrt(np.abs(np.diag(values)))
    is_symmetric = (np.abs(values - values.T) <= ROUNDING * np.outer(size, size)).all()
    if not is_symmetric or not is_semidefinite(values):
        raise ValueError(f"{key}: expected a covariance, symmetric and positive semidefinite")
    return values


def _pose(given: Mapping[str, Any], key: str) -> Array:
    """A pose (4, 4).

    Raises:
        ValueError: The key has other numbers.
    """
    values = _numbers(given, key, (4, 4))
    R = values[:3, :3]
    bottom = np.array([0.0, 0.0, 0.0, 1.0])
    is_rotation = np.allclose(R @ R.T, np.eye(3), atol=RIGID) and np.linalg.det(R) > 0
    if not is_rotation or not np.array_equal(values[3], bottom):
        raise ValueError(f"{key}: expected a pose, a rotation and a place")
    return values

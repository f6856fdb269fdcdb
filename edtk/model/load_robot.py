"""Robots as data: a built-in by name, or a TOML file of the same form."""

import tomllib
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from edtk.model.robot import Joint, Robot, transform

Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector3 = tuple[Finite, Finite, Finite]


class RobotFileError(ValueError):
    """A robot that is not there, or whose file does not say what it should."""


class _Joint(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    name: str
    kind: Literal["revolute", "prismatic"] = "revolute"
    origin_m: Vector3
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    axis: Vector3
    limits_deg: tuple[Finite, Finite] | None = None
    limits_m: tuple[Finite, Finite] | None = None

    @model_validator(mode="after")
    def _limits_fit_the_kind(self) -> "_Joint":
        wanted = "limits_deg" if self.kind == "revolute" else "limits_m"
        if getattr(self, wanted) is None or (
            self.limits_deg is not None and self.limits_m is not None
        ):
            raise ValueError(f"a {self.kind} joint takes {wanted}, and no other limits")
        return self

    def build(self) -> Joint:
        limits = self.limits_m or tuple(np.deg2rad(self.limits_deg or (0.0, 0.0)))
        origin = transform(self.origin_m, np.deg2rad(self.rpy_deg))
        return Joint(
            self.name, origin, np.array(self.axis), (float(limits[0]), float(limits[1])), self.kind
        )


class _Robot(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    name: str
    source: str
    joints: Annotated[tuple[_Joint, ...], Field(min_length=1)]


def builtin_robots() -> tuple[str, ...]:
    """Names of the robots that ship with edtk."""
    folder = files("edtk.model") / "robots"
    return tuple(
        sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))
    )


def load_robot(name: str, folder: Path | None = None) -> Robot:
    """A built-in robot by its name, or a robot file by its path.

    Args:
        name: One of `builtin_robots()`, or a path ending in ".toml".
        folder: What a relative path is relative to.

    Raises:
        RobotFileError: No such robot, or its file is not valid; one line that says where.
    """
    if name.endswith(".toml"):
        file: Traversable = (folder or Path()) / name
    elif name in builtin_robots():
        file = files("edtk.model") / "robots" / f"{name}.toml"
    else:
        raise RobotFileError(
            f"unknown robot {name!r}; built in: {', '.join(builtin_robots())}; or give a path to a .toml file"
        )
    try:
        data = _Robot.model_validate(tomllib.loads(file.read_text(encoding="utf-8")))
        return Robot(data.name, tuple(j.build() for j in data.joints), source=data.source.strip())
    except FileNotFoundError:
        raise RobotFileError(f"robot file {file} not found") from None
    except OSError as error:
        raise RobotFileError(f"robot file {file}: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise RobotFileError(f"robot {name}: {where}: {first['msg']}") from error
    except (tomllib.TOMLDecodeError, ValueError) as error:
        raise RobotFileError(f"robot {name}: {error}") from error

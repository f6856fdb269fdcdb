"""A study: the question that is asked of a robot, and the objects that it describes."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Unpack

from edtk.design.plan import Plan
from edtk.findings.finding import Finding
from edtk.measure.friction import Friction
from edtk.robots.robot import Robot
from edtk.robots.robot_file import robot_to_dict
from edtk.study.check_study import check_study
from edtk.study.kinds import kind_of
from edtk.study.plausibility import plausibility
from edtk.study.schema import Specification, read_specification
from edtk.study.study_model import compensator_numbers
from edtk.study.study_objects import StudyObjects, friction_of
from edtk.study.study_parts import counts_known, designed_keys, study_robot, with_springs
from edtk.study.study_toml import StudyKeys, keys_signature, plain_keys, read_toml, study_toml
from edtk.system.presented import Presented

# Keys that the cell depends on.
CELL = {"robot", "base_link", "tip_link", "controller", "tool", "joints", "scene"}
SPRINGS, COMPENSATORS = "springs", "compensators"  # what designs may depend on a guess of
HASH_DIGITS = 12  # of the SHA-256 that names a study in results


@dataclass(frozen=True, eq=False, init=False)
class Study(StudyObjects, Presented):
    """The question: which poses to measure, to identify which compliances, and for what.

    A study is built from the keys of a study file as keyword arguments, or read from such a file
    by `load_study`:

        >>> study = Study(
        ...     robot="kuka_kr270",
        ...     tool={"position_mm": [611.5, 0, -460]},
        ...     load={"F_N": [0, 0, -2500]},
        ...     measurement={"sigma_mm": 0.03},
        ...     joints={"unknown": ["q2", "q3", "q4", "q5", "q6"], "fixed_deg": {"q1": 0}},
        ... )

    The keys robot, tool, load, measurement and joints are required; `Specification` lists all keys
    with their units and defaults. A study does not change; `replace` makes another.

    Args:
        folder: Folder to which file names in the keys are relative; defaults to the current one.
        keys: The keys of a study file; a key that is None counts as not given.

    Attributes:
        specification: All keys, checked, with their defaults.
        robot: The robot, with the calibration tool.
        folder: Folder to which file names in the specification are relative.
        path: The study's file; None for a study that was built in Python.
        kind: What a study of these unknowns says otherwise than others.
        digest: First twelve hex digits of the SHA-256 of the file, or without a file of `to_toml`.
        excluded: Poses that plans keep away from, besides those of the specification: a plan, its
            file, or None.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """

    specification: Specification
    robot: Robot
    folder: Path
    path: Path | None
    digest: str
    excluded: Path | Plan | None
    _given: Mapping[str, Any]

    def __init__(self, *, folder: Path | str | None = None, **keys: Unpack[StudyKeys]) -> None:
        self._fill(_plain(keys), Path(folder or ""))

    def _fill(self, given: Mapping[str, Any], folder: Path, path: Path | None = None) -> None:
        """Set all attributes but the digest of a file, and check them."""
        self._set(path=path, folder=folder, excluded=None, _given=given)
        specification = read_specification(given, self.where)
        robot = study_robot(specification, self.folder, self.where)
        if specification.controller is not None:
            robot = replace(robot, controller=specification.controller.build(robot, self.where))
        self._set(robot=robot.with_tool(specification.tool.build()))
        if not specification.title:
            title = f"Calibration of {self.robot.name}"
            specification = specification.model_copy(update={"title": title})
        specification = with_springs(specification, robot, self.where)
        self._set(specification=specification, kind=kind_of(specification))
        check_study(self)
        # The name of a file need not be UTF-8.
        self._set(digest=_digest(self.to_toml().encode("utf-8", "surrogateescape")))

    def _set(self, **attributes: object) -> None:
        """Set attributes of a study that is not yet handed out."""
        for name, value in attributes.items():
            object.__setattr__(self, name, value)

    @classmethod
    def from_toml(cls, path: Path | str) -> "Study":
        """Read a study file, see `load_study`."""
        return load_study(path)

    def replace(self, *, folder: Path | str | None = None, **keys: Unpack[StudyKeys]) -> "Study":
        """Make another study, some of whose keys have other values.

        Args:
            folder: Folder to which file names are relative; defaults to this study's.
            keys: Keys and their values, which take the place of the whole value in this study;
                None for a key that shall be as if it had not been given.

        Raises:
            UserError: The new study is not valid.
        """
        removed = {key for key, value in keys.items() if value is None}
        kept = {key: value for key, value in self._given.items() if key not in removed}
        other = Study.__new__(Study)
        other._set(friction=self.friction)
        other._fill(kept | _plain(keys), self.folder if folder is None else Path(folder))
        if folder is None and not CELL & set(keys):
            other._share_cell(self)
        return other.excluding(self.excluded)

    def excluding(self, poses: Path | str | Plan | None) -> "Study":
        """Make the same study whose plans keep away from some poses, besides those that it names.

        Args:
            poses: A plan, or its file (CSV); None for no poses. They take the place of poses that
                were given to `excluding` before.
        """
        other = Study.__new__(Study)
        names = ("specification", "robot", "folder", "path", "digest", "kind", "friction", "_given")
        other._set(**{name: getattr(self, name) for name in names})
        other._set(excluded=Path(poses) if isinstance(poses, str) else poses)
        other._share_cell(self)
        return other

    def _share_cell(self, other: "Study") -> None:
        """Take the cell of another study of the same one, if that is known."""
        if "cell" in vars(other):
            self._set(cell=other.cell)

    def to_toml(self, path: Path | str | None = None) -> str:
        """Write the study as TOML, so that `load_study` gives the same study again.

        Args:
            path: File to write, whole or not at all. None to only return the text, in which file
                names are relative to this study's folder.

        Returns:
            The text. In a file, the names of other files are relative to its own folder.

        Raises:
            UserError: The study excludes a plan that is in no file.
            OSError: The file cannot be written.
        """
        return study_toml(self, path)

    def headline(self) -> str:
        """Title, robot, number of unknown compliances and main criterion."""
        return (
            f"{self.specification.title}; {self.robot.name}, {self.kind.unknowns(self)}, about "
            f"{self.main_criterion}"
        )

    @cached_property
    def with_known(self) -> "Study":
        """The study in which uncertain known compliances are parameters."""
        changed = designed_keys(self)
        return self.replace(**changed) if changed else self

    @cached_property
    def designed(self) -> "Study":
        """The study by which plans are designed, of which more is a parameter.

        Uncertain known compliances are; and so is what friction holds, where the study says how
        much its model leaves out.
        """
        study = self.with_known
        noise = self.specification.noise
        share = 0.0 if noise is None else (noise.model_error_percent or 0.0) / 100
        friction = None if self.friction is not None else friction_of(study, share)
        return study if friction is None else study.with_friction(friction)

    def with_friction(self, friction: Friction) -> "Study":
        """The same study, in which shares of the joints' loads that friction holds are unknown."""
        other = self.excluding(self.excluded)
        other._set(friction=friction)
        return other

    def designed_for(self, criterion: str | None = None) -> "Study":
        """The study by which plans for a criterion are designed, by default the main one."""
        name = self.main_criterion if criterion is None else criterion
        return self.designed if counts_known(name) else self

    @property
    def designs_at_guess(self) -> bool:
        """Whether designs depend on how soft the springs are, which [simulation] guesses."""
        noise = self.specification.noise
        shares = noise is not None and bool(noise.model_error_percent)
        return self.specification.simulation is not None and (
            shares or bool(self.robot.compensators)
        )

    @property
    def guesses(self) -> tuple[str, ...]:
        """What designs depend on and is guessed: springs, and compensators of unknown numbers."""
        springs = (SPRINGS,) if self.designs_at_guess else ()
        return (*springs, COMPENSATORS) if compensator_numbers(self) else springs

    def with_guess_times(self, factor: float, of: str = SPRINGS) -> "Study":
        """The same with springs so many times as soft as [simulation] guesses, or compensators that
        pull so many times as much as the robot's file states.

        Raises:
            UserError: There is no such robot: the arm would snap.
        """
        if of == COMPENSATORS:
            found = tuple(one.times(factor) for one in self.robot.compensators)
            other = self.replace(robot=replace(self.robot, compensators=found))
            other._set(cell=self.cell)  # a robot in Python has no file with its bodies
            return other
        simulation = self.specification.simulation
        assert simulation is not None
        guess = simulation.compliance_rad_per_Nm
        scaled = {name: factor * size for name, size in guess.items()}
        own = simulation.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        return self.replace(simulation=own | {"compliance_rad_per_Nm": scaled})

    @cached_property
    def warnings(self) -> tuple[Finding, ...]:
        """What the study says that is physically hard to believe."""
        return plausibility(self)

    @property
    def reads(self) -> tuple[Path, ...]:
        """All files that the study is read from: its own, and those that it names."""
        specification = self.specification
        named = [*specification.published, *specification.workspace.excluded]
        named += filter(None, (specification.prior.earlier_file, specification.robot_file))
        named += (
            [] if specification.scene is None else [one.file for one in specification.scene.mesh]
        )
        if specification.task is not None:
            named.append(specification.task.file)
        own = [] if self.path is None else [self.path]
        more = [self.excluded] if isinstance(self.excluded, Path) else []
        return (*own, *(self.folder / name for name in named), *more)

    def published_plans(self) -> dict[str, Plan]:
        """The published plans that the study names, by their file's stem.

        Files of the same stem are named by their whole paths, as the study gives them.

        Raises:
            UserError: A file is named twice, or is not that of a plan.
        """
        names = self.specification.published
        stems = [Path(name).stem for name in names]
        keys = [s if stems.count(s) == 1 else n for s, n in zip(stems, names, strict=True)]
        for key in keys:
            if keys.count(key) > 1:
                raise self.error("published", f"{key!r} is named twice; expected each plan once")
        plans = (self.load_plan(self.folder / name) for name in names)
        return dict(zip(keys, plans, strict=True))


# Notebooks and `help` shall list the keys, in place of a bare `**keys`.
Study.__signature__ = keys_signature()  # type: ignore[attr-defined]


def load_study(path: Path | str, excluded: Path | str | Plan | None = None) -> Study:
    """Read and check a study file.

    Args:
        path: The file.
        excluded: A plan, or its file, with poses to stay away from, besides those that the study
            itself excludes.

    Raises:
        UserError: One line that names the file, the key and what was expected.
    """
    path = Path(path)
    content, raw = read_toml(path)
    study = Study.__new__(Study)
    study._fill(content, path.parent, path)
    study._set(digest=_digest(raw))
    return study.excluding(excluded)


def _plain(keys: StudyKeys) -> dict[str, Any]:
    """Keys as a file could hold them; a robot becomes a table, to the last bit."""
    robot = keys.get("robot")
    given = plain_keys(keys)
    return given | {"robot": robot_to_dict(robot)} if isinstance(robot, Robot) else given


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:HASH_DIGITS]

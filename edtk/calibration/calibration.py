"""What a calibration has found, whatever its parameters are, and whether to trust it."""

import hashlib
import math
from abc import abstractmethod
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.calibration.result_file import MeasuredPoses
from edtk.findings.causes.evidence import Weighed
from edtk.findings.causes.family import Cause
from edtk.findings.finding import Finding, verdict
from edtk.fit.posterior import Posterior, SamplingOptions
from edtk.measure.expected_error import ExpectedError, TaskAccuracy, expected_error
from edtk.measure.pose_table import Table
from edtk.measure.task import Tasks
from edtk.study.study import Study
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

MODELS_SHOWN = 8  # models in a table
UNDECIDED = 0.05  # probability of a piece from which, and to one less it, it is undecided
PLAIN = "ideal springs"


@dataclass(frozen=True)
class Origin:
    """The file of the measurements as it was read.

    Attributes:
        sha256: Of the file, in hex digits; empty for a pipe, which cannot be read twice, and for a
            data frame.
        changed: When the file was changed last, "2026-11-22 09:16:27 UTC"; empty likewise. A
            report has this instead of its own date, so that the same run writes the same bytes.
    """

    sha256: str = ""
    changed: str = ""

    @classmethod
    def of(cls, path: Table) -> "Origin":
        """Look at a file that has just been read.

        Args:
            path: The file, or a pipe; or a data frame, which has no file.
        """
        if not isinstance(path, str | Path) or not Path(path).is_file():
            return cls()
        with Path(path).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        seconds = int(Path(path).stat().st_mtime)
        changed = f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S} UTC"
        return cls(digest, changed)


@dataclass(frozen=True, eq=False)
class WeighedModel:
    """A model with some pieces.

    Attributes:
        pieces: Names of its pieces.
        weighed: Its marginal likelihood, and what it says of parameters and pieces.
        weight: Its posterior weight among all models.
        left_out: Root mean square distance of poses that were left out one by one [m, or rad where
            rotations alone are measured].
        expected: Error to expect in the tasks if the model was the right one [m]; NaN without any.
    """

    pieces: tuple[str, ...]
    weighed: Weighed
    weight: float
    left_out: float
    expected: float

    @property
    def words(self) -> str:
        """Its name, for people."""
        return " + ".join((PLAIN, *self.pieces))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "pieces": list(self.pieces),
            "log_evidence": -self.weighed.score / 2,
            "weight": self.weight,
            "left_out_mm": 1e3 * self.left_out,
            "model_error_percent": 100 * self.weighed.share,
            "expected_mm": None if math.isnan(self.expected) else 1e3 * self.expected,
        }


@dataclass(frozen=True, eq=False)
class Extension(Presented):
    """Models of a sheet with their weights, and what remains undecided between them.

    Attributes:
        models: The models that count, the likeliest first; it is the chosen one. That of ideal
            springs is among them.
        tried: How many models were weighed.
        inclusion: Posterior probability of each piece, by name; of those that may be there at all.
        undecided: By how much models differ in the tasks from the chosen one, root mean square over
            their weights [m]; NaN without tasks.
        expected: Error to expect in the tasks, with the noise, what each model leaves out, what
            remains undecided, and all else that is uncertain [m]; NaN without tasks.
        study: The study of the chosen model; the given one where ideal springs are enough.
    """

    models: tuple[WeighedModel, ...]
    tried: int
    inclusion: dict[str, float]
    undecided: float
    expected: float
    study: Study

    @property
    def chosen(self) -> WeighedModel:
        """The likeliest model."""
        return self.models[0]

    @property
    def open(self) -> tuple[str, ...]:
        """Pieces that may be there or not."""
        return tuple(name for name, p in self.inclusion.items() if UNDECIDED < p < 1 - UNDECIDED)

    def headline(self) -> str:
        """The chosen model, and what remains undecided."""
        known = f"{self.chosen.words} ({100 * self.chosen.weight:.0f} %)"
        return known + (f"; undecided: {', '.join(self.open)}" if self.open else "")

    @property
    def shown(self) -> tuple[WeighedModel, ...]:
        """The models of a table: the likeliest, and that of ideal springs."""
        first = self.models[:MODELS_SHOWN]
        plain = [one for one in self.models if not one.pieces and one not in first]
        return (*first, *plain)

    def to_frame(self) -> "pd.DataFrame":
        """A row for each model."""
        import pandas as pd

        return pd.DataFrame(
            {
                "model": [one.words for one in self.models],
                "log_evidence": [-one.weighed.score / 2 for one in self.models],
                "weight": [one.weight for one in self.models],
                "left_out_mm": [1e3 * one.left_out for one in self.models],
                "expected_mm": [1e3 * one.expected for one in self.models],
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        in_tasks = {"undecided_mm": self.undecided, "expected_mm": self.expected}
        return {
            "chosen": list(self.chosen.pieces),
            "models": [one.to_dict() for one in self.models],
            "tried": self.tried,
            "inclusion": self.inclusion,
            "undecided": list(self.open),
            **{name: None if math.isnan(x) else 1e3 * x for name, x in in_tasks.items()},
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration(Presented):
    """What a calibration found, whatever its parameters are, and whether to trust it.

    Attributes:
        findings: Everything that looks wrong, the worst first.
        path: Where the measurements are.
        origin: The file as it was read.
        check: The posterior; None where it was not sampled.
        extension: The models of which this is the likeliest; None where nobody asked for them.
    """

    findings: tuple[Finding, ...]
    path: Path
    origin: Origin = Origin()
    check: PosteriorCheck | None = None
    extension: Extension | None = None

    @property
    @abstractmethod
    def study(self) -> Study:
        """The question."""

    @property
    def asked(self) -> Study:
        """The question as it was given."""
        return self.study

    @property
    @abstractmethod
    def k(self) -> dict[str, float]:
        """Compliances by joint [rad/(N m), or m/N of a prismatic joint]."""

    @property
    @abstractmethod
    def covariance(self) -> Array:
        """Covariance of the parameters by the noise, in the order of `in_tasks`."""

    @property
    @abstractmethod
    def in_tasks(self) -> Tasks:
        """The study's tasks, in which errors of the identified parameters do harm."""

    @property
    @abstractmethod
    def causes(self) -> tuple[Cause, ...]:
        """Faults that explain the measurements, the likeliest first; empty where noise does."""

    @property
    @abstractmethod
    def tasks(self) -> TaskAccuracy | None:
        """Errors to expect in each of several test poses; None for one or none."""

    @property
    @abstractmethod
    def measured_poses(self) -> MeasuredPoses:
        """The poses of the sheet, with the distances of their readings from the fit."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; a number that is not known is null."""

    @abstractmethod
    def residuals(self) -> "pd.DataFrame":
        """The residuals, a row for each reading, or for each of its coordinates."""

    @abstractmethod
    def to_frame(self) -> "pd.DataFrame":
        """A row for each parameter."""

    @abstractmethod
    def sampled(
        self,
        rng: np.random.Generator,
        options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
    ) -> Self:
        """The same calibration with the posterior."""

    @cached_property
    def expected(self) -> ExpectedError | None:
        """Errors to expect in the tasks and around them; None without tasks."""
        return expected_error(self.in_tasks, self.covariance) if self.in_tasks else None

    @property
    def verdict(self) -> str:
        """Whether to use the result: "good", "usable" or "bad".

        It is never better than the worst finding, and not good where the study says what is hard
        to believe.
        """
        return verdict([*self.study.warnings, *self.findings])

    @property
    def posterior(self) -> Posterior | None:
        """The sampled posterior of the parameters; None where it was not sampled."""
        return None if self.check is None else self.check.posterior

    def judgement(self) -> dict[str, Any]:
        """Verdict, findings, posterior and what was known before, for JSON."""
        known = self.study.specification.joints.known
        return {
            "verdict": self.verdict,
            "doubts": [one.words for one in self.findings],
            "study_warnings": [one.words for one in self.study.warnings],
            "diagnostics": [one.to_dict() for one in self.findings],
            "known": {name: one.value for name, one in known.items()},
            "posterior": None if self.check is None else self.check.to_dict(),
            **({} if self.extension is None else {"extension": self.extension.to_dict()}),
        }

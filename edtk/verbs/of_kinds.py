"""What is asked as a question: studies of compliances and of geometry, problems and regions."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import criteria
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.measure.compliances import Compliances, compliances_file
from edtk.measure.pose_table import Table
from edtk.study import kinds
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.verbs.inputs import (
    StudyLike,
    as_study,
    content_of,
    name_of,
)
from edtk.verbs.of_studies import OfStudy
from edtk.verbs.question import Question

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration
    from edtk.calibration.compensate import Calibrated
    from edtk.calibration.detect import Promised
    from edtk.calibration.geometry_question import GeometryQuestion
    from edtk.calibration.template import SheetColumns
    from edtk.design.design_space import DesignSpace
    from edtk.design.exact.exact_plan import ExactPlan
    from edtk.findings.fitted_data import HowFitted
    from edtk.study.study_run import Designs


# Results of compliances, by the argument that they are.
EXPECTED = {
    "compliances": "a calibration, compliances by joint [rad/(N m)], or the path of a k.json file",
    "result": "a result of this study",
}


class OfCompliances(OfStudy):
    """Compliances alone, from displacements under loads."""

    kind: ClassVar[str] = "compliances"

    def _name_of(self, criterion: Mapping[str, Any]) -> str:
        unknown = self.study.specification.joints.unknown
        try:
            return criteria.as_criterion(criterion, unknown).name
        except criteria.MissingTargetError:
            if not self.study.tasks:
                raise
            return str(criterion["name"])  # of parts that get their task with the study

    def setting(self, criterion: str, space: "DesignSpace | None" = None) -> dict[str, Any]:
        """That of the study by which plans for a criterion are designed, in the space searched."""
        from edtk.certificate.certificate import setting_to_dict

        return setting_to_dict(self.study, self.study.space if space is None else space, criterion)

    @staticmethod
    def sought() -> "type[Designs]":
        """Poses with their loads."""
        from edtk.study.study_run import Designs

        return Designs

    def calibrations(self, study: Study, found: Any = None) -> "Designs":
        """With the error budget of springs."""
        from edtk.calibration.planned import SpringDesigns

        return SpringDesigns.of(study)

    def _promised(self, asked: Study, found: "ExactPlan") -> "Promised":
        from edtk.calibration.detect import Promised

        return Promised.displacements(asked, found.whole)

    def _sheet(self, positions: bool, markers: int) -> "SheetColumns":
        from edtk.calibration.template import SheetColumns

        return SheetColumns.of_displacements(self.study, positions, markers)

    def _calibrated(self, sheet: Table, how: "HowFitted") -> "Calibration":
        from edtk.calibration.calibrate import calibrate
        from edtk.calibration.extend import extend

        return extend(self.study, sheet, how) if how.extended else calibrate(self.study, sheet, how)

    def _robot(self, result: Any, argument: str) -> "Calibrated":
        from edtk.calibration.calibrated_springs import CalibratedSprings
        from edtk.calibration.geometric_calibration import GeometricCalibration
        from edtk.calibration.spring_calibration import SpringCalibration

        if isinstance(result, GeometricCalibration):
            message = "expected a study of geometry, as the result is of one"
            raise self.study.error("parameters", message)
        as_it_is = isinstance(result, SpringCalibration | Compliances)
        content: Any = result if as_it_is else content_of(result)
        if isinstance(result, str | Path):
            content = compliances_file(result)
        if content is None:
            message = f"expected {EXPECTED[argument]}, not {type(result).__name__}"
            raise ArgumentError(message, argument=argument)
        return CalibratedSprings(self.study, content, name_of(result, argument))


class OfGeometry(OfStudy):
    """Geometry, base, tools and springs, from positions of markers."""

    kind: ClassVar[str] = "geometry"

    @cached_property
    def _question(self) -> "GeometryQuestion":
        from edtk.calibration.geometry_question import GeometryQuestion

        return GeometryQuestion.of(self.study)

    def _name_of(self, criterion: Mapping[str, Any]) -> str:
        return str(criterion.get("name"))  # which parameters it has only the design knows

    def setting(self, criterion: str, space: "DesignSpace | None" = None) -> dict[str, Any]:
        """That of all designs of the study: neither criterion nor space says more."""
        from edtk.calibration.geometry_question import geometry_setting

        return geometry_setting(self._question)

    @staticmethod
    def sought() -> "type[Designs]":
        """Visits of poses, without and with a load."""
        from edtk.calibration.evaluate_geometry import GeometryDesigns

        return GeometryDesigns

    def _promised(self, asked: Study, found: Any) -> "Promised":
        from edtk.calibration.detect import Promised

        return Promised.visits(found.question, found.whole)

    def calibrations(self, study: Study, found: Any = None) -> "Designs":
        """Those of the question that a plan answers."""
        from edtk.calibration.evaluate_geometry import GeometryDesigns

        return self.designs(study) if found is None else GeometryDesigns(study, found.question)

    def _sheet(self, positions: bool, markers: int) -> "SheetColumns":
        from edtk.calibration.geometry_plan import position_columns

        return position_columns(self.study)

    def _calibrated(self, sheet: Table, how: "HowFitted") -> "Calibration":
        from edtk.calibration.calibrate_geometry import calibrate_geometry
        from edtk.calibration.extend_geometry import extend_geometry

        fit = extend_geometry if how.extended else calibrate_geometry
        return fit(self.study, sheet, how)

    def _robot(self, result: Any, argument: str) -> "Calibrated":
        from edtk.calibration.calibrated_geometry import CalibratedGeometry
        from edtk.calibration.result_file import geometry_result

        content = geometry_result(content_of(result) or result)
        return CalibratedGeometry.of(self.study, content, name_of(result, argument))


# Which kind of study asks which question.
QUESTIONS: Mapping[type, type[OfStudy]] = {
    kinds.Compliances: OfCompliances,
    kinds.Geometry: OfGeometry,
}


def question_of(asked: StudyLike | Problem | Region) -> Question:
    """The question that a study, its file, a problem or a region asks.

    Raises:
        UserError: It is none of these, or the file is not a valid study.
    """
    if isinstance(asked, Problem | Region):
        from edtk.verbs.of_arrays import OfProblem, OfRegion  # as studies do not wait for it

        return OfProblem(asked) if isinstance(asked, Problem) else OfRegion(asked)
    return of_study(asked)


def of_study(study: StudyLike) -> OfStudy:
    """The question of a study.

    Raises:
        UserError: The file is not a valid study.
    """
    found = as_study(study)
    return QUESTIONS[type(found.kind)](found)

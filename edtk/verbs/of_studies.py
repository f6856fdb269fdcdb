"""Sheets of a study, and what follows from them: each verb once, as in `of_designs`."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

from edtk.design.plan import REPEATS, Plan
from edtk.measure.compliances import Compliances
from edtk.measure.pose_table import Table, path_of
from edtk.robots.robot import motors_in_words
from edtk.system.errors import ArgumentError, UserError, note, whole_number
from edtk.system.files import Content, is_standard_output, write_files
from edtk.verbs.inputs import (
    PlanLike,
    as_plan,
    as_table,
    files_of,
    name_of,
    plan_of,
    require_different,
    require_folder,
    require_output,
    text_of,
)
from edtk.verbs.of_designs import OfDesigns

if TYPE_CHECKING:
    import pandas as pd

    from edtk.calibration.calibration import Calibration
    from edtk.calibration.compensate import Calibrated, Compensation
    from edtk.calibration.correct_program import CorrectedProgram
    from edtk.calibration.prediction import Prediction
    from edtk.calibration.template import SheetColumns
    from edtk.findings.fitted_data import HowFitted
    from edtk.verbs.bayes import Sampling

MOST_ROWS = 1_000_000  # of a sheet

CompliancesLike = Union[Compliances, "Calibration", Mapping[str, Any], Path, str]


@dataclass(frozen=True)
class OfStudy(OfDesigns):
    """What a study asks: of designs, of sheets, and of what was measured."""

    def template(
        self, plan: PlanLike, positions: bool, markers: int | None, out: Path | str | None
    ) -> "pd.DataFrame":
        """The sheet to fill in; see `edtk.template`."""
        from edtk.calibration.template import require_empty, template, write_template

        study = self.study
        sensors = study.model.sensors
        if sensors and markers is not None:
            message = f"the study has {len(sensors)} instruments of its own; leave this out"
            raise ArgumentError(message, argument="markers", given=markers)
        measured = as_plan(study, plan)
        if out is not None and not is_standard_output(out):
            require_output(out, *study.reads, *files_of(plan))
            require_empty(Path(out))
        # One row an instrument, reference points included.
        asked = 0 if markers is None else whole_number(markers, "markers", 1)
        each = asked or max(len(study.specification.marker), len(study.model.instruments))
        rows = measured.experiments * each
        if rows > MOST_ROWS:
            raise UserError(
                f"a sheet of {rows} rows, one for each repetition and marker; "
                f"expected {MOST_ROWS} at most",
                where=name_of(plan, "plan"),
            )
        table = template(study, measured, self._sheet(positions, asked))
        for sentence in motors_in_words(study.robot):
            note(f"in the sheet {sentence}", name_of(plan, "plan"))
        if out is not None:
            write_template(table, out)
        return table

    @abstractmethod
    def _sheet(self, positions: bool, markers: int) -> "SheetColumns":
        """The columns of an empty sheet."""

    def identify(
        self,
        sheet: Table,
        how: "HowFitted",
        plan: PlanLike | None,
        sampling: "Sampling | None",
        out: Path | str | None,
    ) -> "Calibration":
        """The parameters from measurements, and their files; see `edtk.identify`."""
        from edtk.report.calibration_report import NAMES, calibration_files
        from edtk.report.views.calibration import EXTENDED

        study = self.study
        sheet = as_table(sheet, "measurements")
        inputs = (*study.reads, *files_of(sheet, plan))
        own = () if sampling is None else (sampling.chain, sampling.export)
        if sampling is not None:
            sampling.require_writable(*inputs)
        require_folder(out)
        names = (*NAMES, EXTENDED) if how.extended else NAMES
        for name in names if out is not None else ():
            require_output(Path(out or "") / name, *inputs, *own)
        planned = None if plan is None else as_plan(study, plan)
        found = self._calibrated(sheet, replace(how, plan=planned, sampled=sampling is not None))
        if sampling is not None:
            with sampling.arguments(path_of(sheet), study.specification.seed) as arguments:
                found = found.sampled(**arguments)
        files: dict[Path, Content] = {}
        if sampling is not None and sampling.export is not None and found.check is not None:
            from edtk.calibration.posterior_check import inference_data

            files[Path(sampling.export)] = inference_data(found.check)
        if out is not None:
            files |= calibration_files(found, Path(out))
        write_files(files)
        return found

    @abstractmethod
    def _calibrated(self, sheet: Table, how: "HowFitted") -> "Calibration":
        """The calibration."""

    def compensate(
        self, result: CompliancesLike, task: PlanLike | None, out: Path | str | None
    ) -> "Compensation":
        """Commands that make up for what was found; see `edtk.compensate`."""
        from edtk.calibration.compensate import compensate

        robot = self._robot(result, "compliances")
        require_output(out, *self.study.reads, *files_of(result, task))
        poses = self._poses(task)
        where = name_of(self.study.where if task is None else task, "task")
        found = compensate(robot, poses, where, own=task is None)
        if out is not None:
            found.to_csv(out)
        return found

    def _poses(self, task: PlanLike | None) -> Plan:
        """The poses of a plan, of a table, or of the study itself."""
        from edtk.calibration.tasks_in_use import load_task

        planned = plan_of(self.study, task, "task")
        if planned is not None:
            return planned
        return load_task(self.study, None if task is None else as_table(task, "task"))

    def correct(
        self,
        result: CompliancesLike,
        program: Path | str,
        out: Path | str | None,
        table: Path | str | None,
        every: bool,
    ) -> "CorrectedProgram":
        """A program whose targets make up for what was found; see `edtk.compensate`."""
        from edtk.calibration.compensate import compensate
        from edtk.calibration.correct_program import ProgramFile, correct_program
        from edtk.measure.cells import csv_text

        robot = self._robot(result, "compliances")
        require_different(out=out, table=table)
        for path in (out, table):
            require_output(path, *self.study.reads, *files_of(result, program))
        found = correct_program(
            self.study,
            ProgramFile.read(Path(program)),
            partial(compensate, robot, path=Path(program)),
            text_of(result),
            every,
        )
        files: dict[Path, Content] = {}
        if out is not None:
            files[Path(out)] = found.content
        if table is not None:
            files[Path(table)] = csv_text(found.to_frame())
        write_files(files)
        return found

    @abstractmethod
    def _robot(self, result: Any, argument: str) -> "Calibrated":
        """The robot that a result is of.

        Args:
            result: A calibration, its file, or what the file would hold.
            argument: The result's name in the call, for messages.

        Raises:
            UserError: It is no result of such a study.
        """

    def predict(
        self, result: Any, poses: PlanLike, tool_rows: int, out: Path | str | None
    ) -> "Prediction":
        """What instruments will read in other poses; see `edtk.predict`."""
        from edtk.measure.cells import csv_text

        study = self.study
        require_output(out, *study.reads, *files_of(result, poses))
        plan = plan_of(study, poses, "poses")
        if plan is None:
            table = as_table(poses, "poses")
        else:
            table = plan.to_frame(study.robot).drop(columns=REPEATS)
        found = self._robot(result, "result").predict(table, tool_rows)
        if out is not None:
            write_files({Path(out): csv_text(found.to_frame())})
        return found

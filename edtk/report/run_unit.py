"""The unit in which a person reads a criterion of a study's run."""

from edtk.calibration.geometry_design.geometry_designs import GeometryDesigns
from edtk.report.shown_unit import shown_unit
from edtk.study.study_run import StudyRun

OWN = "own units"  # of the parameters: mm, mrad, 1e-6 rad/(N m)


def run_unit(run: StudyRun, name: str) -> tuple[float, str]:
    """Factor and unit for a criterion's values; where it names none, those of the parameters."""
    factor, unit = shown_unit(name)
    is_own = unit == "SI" and isinstance(run.designs, GeometryDesigns)
    return factor, OWN if is_own else unit

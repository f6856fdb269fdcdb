"""One question is a file, its answer is a table."""

from edtk.study.evaluate import Evaluation, evaluate
from edtk.study.runner import run_study
from edtk.study.study import Study, load_study

__all__ = ["Evaluation", "Study", "evaluate", "load_study", "run_study"]

"""`edtk.load_study`: a study from its file."""

from pathlib import Path

from edtk.study.study import Study
from edtk.study.study import load_study as read_study


def load_study(path: Path | str, exclude: Path | str | None = None) -> Study:
    """Read and validate a study file.

    Args:
        path: The file (TOML).
        exclude: A plan (CSV) of poses to stay away from, besides those that the study excludes.

    Returns:
        The study, with its robot, its design space and its test pose.

    Raises:
        UserError: One line that names the file, the key and what was expected.
    """
    return read_study(path, exclude)

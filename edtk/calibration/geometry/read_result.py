"""The result of a calibration of geometry, from a file or from an object."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.system.errors import UserError
from edtk.system.parse_json import parse_json
from edtk.system.read_text import read_text

MOST_MB = 100.0  # of a file


def read_result(given: GeometricCalibration | Mapping[str, Any] | Path | str) -> Mapping[str, Any]:
    """The keys of a result, `geometry` among them.

    Args:
        given: A calibration, its `to_dict`, or the path of a JSON file that holds it.

    Raises:
        UserError: It is no such result.
    """
    content: Any = given
    if isinstance(given, GeometricCalibration):
        content = given.to_dict()
    elif isinstance(given, str | Path):
        content = parse_json(read_text(Path(given), MOST_MB), given)
    if not isinstance(content, Mapping) or not isinstance(content.get("geometry"), Mapping):
        raise UserError(
            "no result of a study with [parameters]; expected what edtk identify --json wrote",
            where=given if isinstance(given, str | Path) else "result",
        )
    return content

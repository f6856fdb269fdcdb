"""What serves only studies that load and measure the tool point."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from edtk.study.study import Study


def require_plain(study: "Study", what: str) -> None:
    """Refuse a study that loads or measures other points than the tool point.

    Args:
        study: The study.
        what: What cannot serve it, in words.

    Raises:
        UserError: Names the table.
    """
    if study.model.is_plain:
        return
    given = study.specification
    tables = (("marker", given.marker), ("distance", given.distance), ("payload", given.payload))
    key = next((name for name, table in tables if table), None)
    if key is None:
        key = "measurement.reference" if study.model.weights is not None else "load.at_mm"
    raise study.error(key, f"{what} cannot take it into account yet")

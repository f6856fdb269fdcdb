"""What the rows of an experiment are called, where it has all of a study's instruments."""

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.tables.coordinate_columns import coordinate_names


def measured_names(model: ElastostaticModel) -> tuple[str, ...]:
    """Names (rows,) of what an experiment measures, such as "x", or "forearm x" and "wire".

    Args:
        model: The model, whose instruments are measured one after another.
    """
    instruments = model.instruments
    if len(instruments) == 1:
        return coordinate_names(instruments[0].rows)
    return tuple(
        sensor.name if sensor.rows == 1 else f"{sensor.name} {coordinate}"
        for sensor in instruments
        for coordinate in coordinate_names(sensor.rows)
    )

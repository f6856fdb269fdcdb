"""The setting of a study's designs, for certificates."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from edtk.design.design_space import DesignSpace
    from edtk.study.study import Study


def setting_of(study: "Study", space: "DesignSpace | None" = None) -> dict[str, Any]:
    """Robot, load, noise, constraints and tasks of a study as plain data.

    Args:
        study: The study, of compliances or of geometry.
        space: The design space that was searched; defaults to the study's.
    """
    if study.specification.parameters is not None:
        from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
        from edtk.calibration.geometry_design.geometry_setting import geometry_setting

        return geometry_setting(GeometryQuestion.of(study))
    from edtk.certificate.setting_to_dict import setting_to_dict

    return setting_to_dict(study, study.space if space is None else space)

"""Text of identified compliances."""

from edtk.inference.identification import Identification


def identification(fit: Identification) -> str:
    """The headline, and a row a compliance with its 95 % interval [rad/(N m)]."""
    table = fit.to_frame().to_string(index=False, float_format="{:.4g}".format)
    return f"{fit.headline()}\n{table}"

"""edtk: plans of experiments that can be trusted, for robot calibration and any linear(ised) model."""

from edtk.version import __version__

__all__ = ["__version__"]

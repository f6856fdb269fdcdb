"""edtk: plans of experiments that can be trusted, for robot calibration and any linear(ised) model."""

__version__ = "0.1.0"

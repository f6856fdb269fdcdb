"""Headers of columns besides those of poses and wrenches."""

# Displacement of the marker under load, or its position without and with load, in the world frame.
DEFLECTION_COLUMNS = ("dx_mm", "dy_mm", "dz_mm")
UNLOADED_COLUMNS = ("x0_mm", "y0_mm", "z0_mm")
LOADED_COLUMNS = ("x_mm", "y_mm", "z_mm")
# Rotation of the tool under load, a small rotation vector in the world frame.
ROTATION_COLUMNS = ("drx_deg", "dry_deg", "drz_deg")
# The same of a distance, or of a single coordinate: its change, or both readings.
CHANGE_COLUMN = "change_mm"
BEFORE_COLUMN = "before_mm"
AFTER_COLUMN = "after_mm"
# The change of a single rotation.
TURN_COLUMN = "rotation_change_deg"
# Standard deviation of each coordinate of a displacement.
SIGMA_COLUMN = "sigma_mm"
# The same where it is not that of every axis: a laser tracker measures distances best.
AXIS_SIGMA_COLUMNS = ("sigma_x_mm", "sigma_y_mm", "sigma_z_mm")
# Covariance of a displacement in the world frame, as trackers write it: the upper triangle.
COVARIANCE_COLUMNS = (
    "cov_xx_mm2",
    "cov_xy_mm2",
    "cov_xz_mm2",
    "cov_yy_mm2",
    "cov_yz_mm2",
    "cov_zz_mm2",
)
# Offset of the marker from the tool point, in the tool frame.
MARKER_COLUMNS = ("marker_x_mm", "marker_y_mm", "marker_z_mm")
# Number of the visit of a pose: readings within a visit share the errors of the joints.
VISIT_COLUMN = "visit"
# Name of the marker, or of the distance, that a row is of.
MARKER_NAME_COLUMN = "marker"

# A row of which all of these are empty is yet to be measured.
FINISHED_BY = (
    *DEFLECTION_COLUMNS,
    *LOADED_COLUMNS,
    *ROTATION_COLUMNS,
    CHANGE_COLUMN,
    AFTER_COLUMN,
    TURN_COLUMN,
)

# Columns of a measurement sheet that are there together or not at all.
MEASURED_TOGETHER = (
    DEFLECTION_COLUMNS,
    (*UNLOADED_COLUMNS, *LOADED_COLUMNS),
    ROTATION_COLUMNS,
    (SIGMA_COLUMN,),
    AXIS_SIGMA_COLUMNS,
    COVARIANCE_COLUMNS,
    MARKER_COLUMNS,
    (VISIT_COLUMN,),
    (MARKER_NAME_COLUMN,),
    (CHANGE_COLUMN,),
    (BEFORE_COLUMN, AFTER_COLUMN),
    (TURN_COLUMN,),
)
SHEET_COLUMNS = tuple(column for group in MEASURED_TOGETHER for column in group)

# Errors of a compensated task without compensation, and with it: root mean square and band.
# They begin with the row of the task where some of its rows are left out.
ROW_COLUMN = "row"
UNCOMPENSATED_COLUMN = "uncompensated_mm"
REMAINING_COLUMN = "remaining_rms_mm"
BAND_COLUMNS = ("remaining_low_mm", "remaining_high_mm")
# Parts of what remains: by the noise, and by joints that are not identified.
PART_COLUMNS = ("remaining_by_noise_mm", "remaining_by_assumed_joints_mm")
UNCOMPENSATED_ROTATION_COLUMN = "uncompensated_rotation_deg"
REMAINING_ROTATION_COLUMN = "remaining_rotation_rms_deg"

# Headers that no joint may have.
RESERVED = (
    *SHEET_COLUMNS,
    ROW_COLUMN,
    UNCOMPENSATED_COLUMN,
    REMAINING_COLUMN,
    *BAND_COLUMNS,
    *PART_COLUMNS,
    UNCOMPENSATED_ROTATION_COLUMN,
    REMAINING_ROTATION_COLUMN,
)

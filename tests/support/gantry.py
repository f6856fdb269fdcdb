"""A made-up arm with a prismatic joint, whose task tells nothing of the wrist."""

ROBOT = """
name = "gantry arm"
source = "made up for this test"
[[joints]]
name = "slide"
kind = "prismatic"
origin_m = [0, 0, 1.0]
axis = [0, 1, 0]
limits_m = [-1.0, 1.0]
[[joints]]
name = "shoulder"
origin_m = [0.2, 0, 0]
axis = [0, 0, 1]
limits_deg = [-150, 150]
[[joints]]
name = "elbow"
origin_m = [0.7, 0, 0]
axis = [0, 1, 0]
limits_deg = [-120, 120]
[[joints]]
name = "wrist"
origin_m = [0.6, 0, 0]
rpy_deg = [0, 30, 0]
axis = [1, 0, 0]
limits_deg = [-180, 180]
"""
STUDY = """
title = "Gantry arm"
robot = "gantry.toml"
seed = 3
sizes = [3]
candidates = 300
starts = 64
optimise = ["rho0"]
criteria = ["G", "rho0"]
[tool]
position_mm = [100, 50, -200]
[load]
F_N = [100, -200, -300]
T_Nm = [10, 0, 5]
[measurement]
rows = "pose"
sigma_mm = 0.05
sigma_deg = 0.01
[joints]
unknown = ["shoulder", "elbow", "wrist"]
fixed_mm = { slide = 250 }
[workspace]
height_min_mm = 300
[test_pose]
q_deg = [-100, 20, 30, 40]
tool = { position_mm = [150, 0, 0] }
load = { F_N = [0, 100, -50], T_Nm = [0, 0, 10] }
[simulation]
compliance_rad_per_Nm = { shoulder = 1e-6, elbow = 2e-6, wrist = 5e-6 }
"""

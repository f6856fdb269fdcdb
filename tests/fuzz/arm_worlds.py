"""The files of worlds of an arm, of its rotations, and of an arm on a rail."""

ROBOT = """
name = "arm"
source = "made up"

[[joints]]
name = "q1"
origin_m = [0, 0, 0.5]
axis = [0, 0, 1]
limits_deg = [-170, 170]

[[joints]]
name = "q2"
origin_m = [0.1, 0, 0.3]
axis = [0, 1, 0]
limits_deg = [-120, 60]

[[joints]]
name = "q3"
origin_m = [0.7, 0, 0]
axis = [0, 1, 0]
limits_deg = [-120, 150]
"""

RAIL_ROBOT = """
name = "rail"
source = "made up"
base = { position_m = [0, 0, 0.2], rpy_deg = [0, 0, 90] }

[[joints]]
name = "rail"
kind = "prismatic"
origin_m = [0, 0, 0.5]
axis = [1, 0, 0]
limits_m = [0, 2]

[[joints]]
name = "shoulder"
origin_m = [0.1, 0, 0.3]
rpy_deg = [0, 0, 10]
axis = [0, 1, 0]
limits_rad = [-2, 1]

[[joints]]
name = "elbow"
origin_m = [0.7, 0, 0]
axis = [0, 1, 0]
limits_deg = [-120, 150]
"""

ARM = """
title = "Arm"
robot = "robot.toml"
seed = 7
sizes = [2]
candidates = 30
starts = 1
optimise = ["D"]
criteria = ["D", "rho0"]
published = ["pub.csv"]

[tool]
position_mm = [500, 0, 50]

[load]
F_N = [0, 0, -300]

[measurement]
sigma_mm = 0.1

[joints]
unknown = ["q2", "q3"]
fixed_deg = { q1 = 0 }

[test_pose]
q_deg = [0, -60, 80]
tool = { position_mm = [600, 0, 0] }
load = { F_N = [0, 100, -200] }

[simulation]
compliance_rad_per_Nm = { q2 = 1e-6, q3 = 3e-6 }
"""

POSE = """
title = "Arm with rotations"
robot = "robot.toml"
seed = 1
sizes = [2]
candidates = 20
sampling = "sobol"
starts = 1
optimise = ["rho0"]
criteria = ["rho0", "rho_max", "A"]
published = ["pub.csv"]

[tool]
position_mm = [500, 0, 50]
rpy_deg = [0, 90, 0]

[load]
F_N = [0, 20, -300]
T_Nm = [1, 2, 3]

[measurement]
rows = "pose"
sigma_mm = 0.1
sigma_deg = 0.02

[joints]
unknown = ["q1", "q2", "q3"]

[workspace]
height_min_mm = -500
radius_min_mm = 100
tilt_max_deg = 90
plan_resolution_deg = 0.1
excluded = ["exclude.csv"]
excluded_within_deg = 2

[task]
file = "task.csv"
tool = { position_mm = [600, 0, 0], rpy_deg = [0, 0, 5] }
load = { F_N = [0, 100, -200], T_Nm = [0, 1, 0] }

[simulation]
compliance_rad_per_Nm = { q1 = 2e-6, q2 = 1e-6, q3 = 3e-6 }

[prior]
earlier_file = "earlier.json"
sigma_factor = 2
nu = 5
all = { kind = "half-normal", scale_rad_per_Nm = 1e-5 }

[prior.joints]
q2 = { kind = "log-normal", median_rad_per_Nm = 1e-6, factor = 2 }
"""

RAIL = """
title = "Rail"
robot = "robot.toml"
sizes = [2, 3]
candidates = 20
starts = 1
optimise = ["E"]

[tool]
position_mm = [500, 0, 50]

[load]
F_max_N = 300
direction = [0, 0, -1]

[measurement]
sigma_mm = 0.1

[joints]
unknown = ["shoulder", "elbow"]
fixed_mm = { rail = 100 }

[[test_pose]]
q_deg = [500, -60, 80]
tool = { position_mm = [600, 0, 0] }
load = { F_N = [0, 100, -200] }

[[test_pose]]
q_deg = [200, -30, 100]
tool = { position_mm = [600, 0, 0] }
load = { F_N = [50, 0, -200] }
weight = 3

[simulation]
compliance_rad_per_Nm = { shoulder = 1e-6, elbow = 3e-6 }

[prior.earlier]
mean_rad_per_Nm = { shoulder = 1e-6, elbow = 3e-6 }
covariance = [[1e-12, 0], [0, 1e-12]]
"""

PLAN = """q1_deg,q2_deg,q3_deg,repeats
0,-60,80,1
10,-30,40,2
-20,-80,110,1
"""
TASK = """q1_deg,q2_deg,q3_deg,Fx_N,Fy_N,Fz_N,Tx_Nm
0,-60,80,0,100,-200,0
15,-45,60,10,0,-100,1
"""
EXCLUDE = "q1_deg,q2_deg,q3_deg\n100,-100,-100\n"

RAIL_PLAN = """rail_mm,shoulder_deg,elbow_deg,Fx_N,Fy_N,Fz_N,repeats
100,-60,80,0,0,-300,1
100,-30,40,0,0,-300,2
100,-80,110,0,0,-150,1
"""
RAIL_TASK = """rail_mm,shoulder_deg,elbow_deg,Fz_N
500,-60,80,-200
700,-45,60,-100
"""
RAIL_EXCLUDE = "rail_mm,shoulder_deg,elbow_deg\n100,-100,-100\n"
EARLIER = '{"k": {"q1": 2e-6, "q2": 1e-6, "q3": 3e-6}, "std": [1e-6, 1e-6, 1e-6]}\n'

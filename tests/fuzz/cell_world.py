"""The files of a world with a URDF, a controller, markers, a payload, noise and several tasks."""

URDF = """<?xml version="1.0"?>
<robot name="cell">
  <link name="base"/>
  <link name="column"><inertial><origin xyz="0 0 0.1"/><mass value="40"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.3 0 0"/><mass value="20"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.3 0 0"/><mass value="8"/></inertial></link>
  <link name="flange"/>
  <link name="camera"/>
  <joint name="turn" type="continuous">
    <origin xyz="0 0 0.5"/><parent link="base"/><child link="column"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="lift" type="revolute">
    <origin xyz="0.1 0 0.3" rpy="0 0.1 0"/><parent link="column"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="1"/>
  </joint>
  <joint name="bend" type="revolute">
    <origin xyz="0.7 0 0"/><parent link="upper"/><child link="fore"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2.5"/>
  </joint>
  <joint name="plate" type="fixed">
    <origin xyz="0.6 0 0"/><parent link="fore"/><child link="flange"/>
  </joint>
  <joint name="eye" type="fixed"><parent link="upper"/><child link="camera"/></joint>
</robot>
"""

STUDY = """
title = "Cell"
robot = "robot.urdf"
base_link = "base"
tip_link = "flange"
sizes = [2]
candidates = 20
starts = 1
optimise = ["rho_max"]
criteria = ["rho_max", "rho0", "D"]

[controller]
sign = { lift = -1 }
zero_deg = { bend = 90 }
follows = { bend = "lift" }

[tool]
position_mm = [100, 0, 50]

[payload]
mass_kg = 30
center_mm = [50, 0, 0]

[[marker]]
name = "A"
position_mm = [0, 0, 0]

[[marker]]
name = "B"
position_mm = [0, 200, 50]

[measurement]
sigma_mm = 0.02

[noise]
tracker_position_mm = [4000, 1000, 500]
along = [5, 2]
across = [10, 5]
given_as = "sigma"
repeatability_deg = 0.002
discrepancy_mm = 0.01

[joints]
unknown = ["lift", "bend"]
fixed_deg = { turn = 10 }

[[test_pose]]
q_deg = [0, 60, 110]
tool = { position_mm = [150, 0, 0] }
load = { F_N = [0, 100, -200] }
weight = 2

[[test_pose]]
q_deg = [20, 30, 150]
tool = { position_mm = [150, 0, 0] }
payload = { mass_kg = 20 }
robust_deg = 5

[interest]
joints = ["bend"]
combinations = [{ lift = 1, bend = -0.5 }]

[simulation]
compliance_rad_per_Nm = { lift = 1e-6, bend = 3e-6 }
"""

PLAN = """turn_deg,lift_deg,bend_deg,repeats
10,60,130,1
10,30,110,2
10,80,150,1
"""

TASK = """turn_deg,lift_deg,bend_deg,Fx_N,Fy_N,Fz_N
0,60,110,0,100,-200
20,30,150,10,0,-100
"""

EXCLUDE = "turn_deg,lift_deg,bend_deg\n10,20,20\n"

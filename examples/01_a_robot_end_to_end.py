"""
A robot, end to end
===================

A heavy robot mills, and bends under the cutting force. Which poses should be measured, so that the
compensation is accurate in the task? This example goes from the robot to corrected commands, with
simulated measurements in the place of a laser tracker.
"""

# %%
# The question
# ------------
# A study names the robot, the load that the lab can apply, the noise of the tracker, the poses
# that are allowed, and the pose in which the robot shall be accurate. Units are part of every
# key.

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import edtk

study = edtk.Study(
    robot="kuka_kr270",
    tool={"position_mm": [611.5, 0, -460]},
    load={"F_N": [0, 0, -2500]},
    measurement={"sigma_mm": 0.03},
    joints={
        "unknown": ["q2", "q3", "q4", "q5", "q6"],
        "fixed_deg": {"q1": 0},
    },
    workspace={"height_min_mm": 800, "radius_min_mm": 600, "tilt_max_deg": 30},
    test_pose={
        "q_deg": [0, -56.9, 89.3, 45.1, 76, 57.2],
        "tool": {"position_mm": [986, 0, 0]},
        "load": {"F_N": [0, 280, -180]},
    },
    candidates=2000,
    simulation={
        "compliance_rad_per_Nm": {
            "q2": 0.3e-6,
            "q3": 0.4e-6,
            "q4": 2.8e-6,
            "q5": 2.8e-6,
            "q6": 2.1e-6,
        }
    },
)
study

# %%
# The plan
# --------
# ``edtk.plan`` looks for the best plan of exactly six experiments. ``bound`` is a number that no
# plan of six experiments can beat, so the efficiency says how much a longer search could gain at
# most.

plan = edtk.plan(study, size=6, seed=1, workers=1)
print(plan.summary())

# %%
# The picture shows the joint angles of each pose.

plan.plot()

# %%
# The day in the lab
# ------------------
# ``edtk.template`` writes the sheet on which the measurements are noted. Here a simulation fills
# it in.

folder = Path(mkdtemp())
sheet = edtk.template(study, plan.plan)
q = np.deg2rad(sheet.iloc[:, :6].to_numpy())
wrench = sheet[["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]].to_numpy()
deflection = study.model.regressor(q, wrench) @ study.compliances
noise = 0.03e-3 * np.random.default_rng(7).standard_normal(deflection.shape)
sheet[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * (deflection + noise)
sheet.to_csv(folder / "day1.csv", index=False)

# %%
# Parameters and a verdict
# ------------------------
# ``edtk.identify`` fits the compliances, and says whether the result can be trusted.

calibration = edtk.identify(study, folder / "day1.csv", out=folder / "result")
print(calibration.summary())

# %%

calibration.plot()

# %%
# Corrected commands
# ------------------
# A task is a list of poses and wrenches; without wrench columns the load of the test pose acts.

task = folder / "task.csv"
task.write_text(
    "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,-56.9,89.3,45.1,76,57.2\n0,-60,95,45.1,76,57.2\n"
)
commands = edtk.compensate(study, folder / "result" / "k.json", task)
print(commands.summary())

"""Three robots with loads, tools and true compliances, on which faults are tried."""

from pathlib import Path

import numpy as np

from edtk import Study, load_study

HERE = Path(__file__).parent
GRAVITY = 9.81  # [m/s^2]


def robots() -> dict[str, Study]:
    """The studies by the names of their robots; each gives the true compliances too."""
    return {
        "KR 270, 2500 N": load_study(HERE / "kr270_milling.toml"),
        "UR10, 10 kg": _ur10(),
        "7R arm, 14 kg": _seven_joints(),
    }


def _ur10() -> Study:
    """A UR10 with 10 kg, by the DH parameters that Universal Robots publishes.

    Compliances are of the order of strain-wave gears of its sizes, not measured.
    """
    a = (0.0, -0.612, -0.5723, 0.0, 0.0, 0.0)
    d = (0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922)
    alpha = (90.0, 0.0, 0.0, 90.0, -90.0, 0.0)
    names = ("q1", "q2", "q3", "q4", "q5", "q6")
    limits = ((-180, 180), (-180, 0), (-150, 150), (-180, 180), (-180, 180), (-180, 180))
    return Study(
        title="UR10 with 10 kg",
        robot={
            "name": "UR10",
            "source": "DH parameters that Universal Robots publishes.",
            "joints": _joints(names, a, d, alpha, limits),
            "tool": {"position_m": [a[5], 0, d[5]], "rpy_deg": [alpha[5], 0, 0]},
        },
        tool={"position_mm": [120, 0, 180]},
        load={"F_N": [0, 0, -10 * GRAVITY]},
        measurement={"sigma_mm": 0.03},
        joints={"unknown": ["q2", "q3", "q4", "q5", "q6"], "fixed_deg": {"q1": 0}},
        workspace={"height_min_mm": 100, "radius_min_mm": 300},
        test_pose={
            "q_deg": [0, -60, 90, -40, -70, 20],
            "tool": {"position_mm": [120, 0, 180]},
            "load": {"F_N": [40, 20, -80]},
        },
        simulation={
            "compliance_rad_per_Nm": {
                "q2": 4e-5,
                "q3": 5e-5,
                "q4": 1.2e-4,
                "q5": 1.5e-4,
                "q6": 2e-4,
            }
        },
    )


def _seven_joints() -> Study:
    """An arm of seven joints with the lengths that KUKA publishes for its LBR iiwa 14.

    Compliances are of the order of strain-wave gears of its sizes, not measured.
    """
    a = (0.0,) * 7
    d = (0.36, 0.0, 0.42, 0.0, 0.4, 0.0, 0.126)
    alpha = (-90.0, 90.0, 90.0, -90.0, -90.0, 90.0, 0.0)
    names = tuple(f"q{i}" for i in range(1, 8))
    limits = tuple((-size, size) for size in (170, 120, 170, 120, 170, 120, 175))
    compliances = {"q2": 4e-5, "q3": 6e-5, "q4": 6e-5, "q5": 1e-4, "q6": 1.5e-4, "q7": 2e-4}
    return Study(
        title="7R arm with 14 kg",
        robot={
            "name": "7R arm",
            "source": "Lengths that KUKA publishes for the LBR iiwa 14 R820.",
            "joints": _joints(names, a, d, alpha, limits),
            "tool": {"position_m": [0, 0, d[6]]},
        },
        tool={"position_mm": [120, 0, 180]},
        load={"F_N": [0, 0, -14 * GRAVITY]},
        measurement={"sigma_mm": 0.03},
        joints={"unknown": list(compliances), "fixed_deg": {"q1": 0}},
        workspace={"height_min_mm": 100, "radius_min_mm": 250},
        test_pose={
            "q_deg": [0, 40, 20, -80, 30, 60, 10],
            "tool": {"position_mm": [120, 0, 180]},
            "load": {"F_N": [40, 20, -100]},
        },
        simulation={"compliance_rad_per_Nm": compliances},
    )


def _joints(
    names: tuple[str, ...],
    a: tuple[float, ...],
    d: tuple[float, ...],
    alpha: tuple[float, ...],
    limits: tuple[tuple[float, float], ...],
) -> list[dict[str, object]]:
    """Joints of a table of DH parameters [m, deg], as the keys of a robot file.

    Joint i turns about z, then ``Tz(d) Tx(a) Rx(alpha)`` leads to the next joint's origin.
    """
    before = zip((0.0, *a), (0.0, *d), (0.0, *alpha), strict=True)
    return [
        {
            "name": name,
            "origin_m": [float(x), 0.0, float(z)],
            "rpy_deg": [float(turn), 0.0, 0.0],
            "axis": [0, 0, 1],
            "limits_deg": list(np.array(limit, dtype=float)),
        }
        for name, (x, z, turn), limit in zip(names, before, limits, strict=False)
    ]

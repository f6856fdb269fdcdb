"""Corrected robot programs: what they promise, on an arm that is simulated apart from edtk.

Programs are written and read here with regular expressions and scipy's rotations, which edtk's
readers do not know. The controller is simulated, too: by scipy, from the drawing of the arm.
"""

import json
import re

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import edtk
from edtk.robots.load_robot import load_robot

ROBOT = load_robot("kuka_kr270")
K = np.array([0, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
JOINTS = ("q2", "q3", "q4", "q5", "q6")
WRENCH = np.array([300.0, -200.0, -2500.0, 0, 0, 0])
TOOL = np.array([0.986, 0.1, 0.05])
TOOL_TURN = Rotation.from_euler("xyz", [10, 80, -20], degrees=True)
BASE = np.array([0.4, -0.3, 0.2])
BASE_TURN = Rotation.from_euler("xyz", [2, -3, 40], degrees=True)


def placed(mm, rotation):
    """A frame of a study."""
    rpy = rotation.as_euler("xyz", degrees=True)
    return {"position_mm": (1e3 * mm).tolist(), "rpy_deg": rpy.tolist()}


TASK = {"tool": placed(TOOL, TOOL_TURN), "load": {"F_N": WRENCH[:3].tolist()}}
STUDY = edtk.Study(
    robot="kuka_kr270",
    tool={"position_mm": [611.5, 0, -460]},
    load={"F_N": [0, 0, -2500]},
    measurement={"sigma_mm": 0.03},
    joints={"unknown": list(JOINTS)},
    test_pose={"q_deg": [0, -60, 60, 30, 30, 0], **TASK},
)
FOUND = dict(zip(JOINTS, K[1:].tolist(), strict=True))


def homogeneous(position, rotation):
    T = np.eye(4)
    T[:3, :3] = rotation.as_matrix()
    T[:3, 3] = position
    return T


@pytest.fixture(scope="module")
def arm(script):
    """The arm under its load, and with rigid joints as the controller has it."""
    return script("simulated_arm.py").SimulatedArm(
        origins=np.array([joint.origin for joint in ROBOT.joints]),
        axes=np.array([joint.axis for joint in ROBOT.joints]),
        compliance=K,
        tool=homogeneous(TOOL, TOOL_TURN),
    )


def places(arm, q, loaded=False):
    """Where the tool is (m, 4, 4)."""
    x = arm.rest(q, WRENCH) if loaded else None
    return np.real(arm.frames(q, x)[0][-1])


def controller(arm, T, near):
    """Joints near some others at which the drawing has its tool in a place."""

    def off(q):
        there = places(arm, q)
        turn = Rotation.from_matrix(there[:3, :3] @ T[:3, :3].T).as_rotvec()
        return np.concatenate([there[:3, 3] - T[:3, 3], turn])

    found = least_squares(off, near, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert np.abs(off(found.x)).max() < 1e-8
    return found.x


def sides(arm, q):
    """Whether the wrist is ahead of the first axis, and whether A3 makes the arm longer."""
    bodies, before = arm.frames(q)
    wrist = bodies[4][:3, 3]
    ahead = np.cos(q[0]) * wrist[0] + np.sin(ROBOT.joints[0].axis[2] * q[0]) * wrist[1]
    bent = arm.frames(q + 1e-5 * np.eye(6)[2])[0][4][:3, 3]
    shoulder = before[1][:3, 3]
    return ahead > 0, np.linalg.norm(bent - shoulder) > np.linalg.norm(wrist - shoulder)


def krl(arm, degrees, poses):
    lines = ["&ACCESS RVP", "DEF demo ( )", "; {A1 1} \xe4\xf6\xfc"]
    for q in degrees:
        values = ", ".join(f"A{j} {x:.4f}" for j, x in enumerate(q, 1))
        lines.append(f"PTP {{{values}}} C_PTP")
    x, y, z = 1e3 * TOOL
    c, b, a = TOOL_TURN.as_euler("xyz", degrees=True)
    lines.append(f"$TOOL={{X {x:.9f},Y {y:.9f},Z {z:.9f},A {a:.9f},B {b:.9f},C {c:.9f}}}")
    lines.append("$BASE=BASE_DATA[3]")
    for q, T in zip(np.deg2rad(degrees), poses, strict=True):
        x, y, z = 1e3 * T[:3, 3]
        c, b, a = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True)
        ahead, longer = sides(arm, q)
        status = int(not ahead) + 2 * int(not longer) + 4 * int(q[4] < 0)
        turn = sum(2**j for j in range(6) if q[j] < 0)
        pose = f"X {x:.5f}, Y {y:.5f}, Z {z:.5f}, A {a:.6f}, B {b:.6f}, C {c:.6f}"
        lines.append(f"PTP {{E6POS: {pose}, S {status}, T {turn}, E1 0.0}}")
    return "\r\n".join([*lines, "END", ""]), "demo.src"


def krl_back(text):
    joints = re.findall(r"PTP \{A1 (\S+), A2 (\S+), A3 (\S+), A4 (\S+), A5 (\S+), A6 (\S+)\}", text)
    poses = re.findall(
        r"E6POS: X (\S+), Y (\S+), Z (\S+), A (\S+), B (\S+), C (\S+), S \d+, T \d", text
    )
    values = np.array(poses, dtype=float)
    turns = Rotation.from_euler("ZYX", values[:, 3:], degrees=True)
    return np.array(joints, dtype=float), values[:, :3] / 1e3, turns


def listed(values, digits):
    return "[" + ",".join(f"{x:.{digits}f}" for x in values) + "]"


def rapid(arm, degrees, poses):
    w = np.roll(TOOL_TURN.as_quat(), 1)
    u = np.roll(BASE_TURN.as_quat(), 1)
    none = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"
    load = "[1,[0,0,1],[1,0,0,0],0,0,0]"
    lines = ["MODULE demo", "  ! p1 \xe9 [1,2]"]
    lines.append(
        f"  PERS tooldata tDrill:=[TRUE,[{listed(1e3 * TOOL, 9)},{listed(w, 12)}],{load}];"
    )
    lines.append(
        f'  PERS wobjdata table:=[FALSE,TRUE,"",[{listed(1e3 * BASE, 9)},{listed(u, 12)}],'
        "[[0,0,0],[1,0,0,0]]];"
    )
    names = []
    for i, q in enumerate(degrees):
        lines.append(f"  CONST jointtarget j{i}:=[{listed(q, 4)},{none}];")
        names.append(f"    MoveAbsJ j{i}\\NoEOffs,v100,fine,tDrill;")
    for i, (q, T) in enumerate(zip(np.deg2rad(degrees), poses, strict=True)):
        quaternion = np.roll(Rotation.from_matrix(T[:3, :3]).as_quat(), 1)
        ahead, longer = sides(arm, q)
        cfx = int(q[4] < 0) + 2 * int(longer) + 4 * int(not ahead)
        conf = [*(int(np.floor(q[j] / (np.pi / 2))) for j in (0, 3, 5)), cfx]
        target = f"[{listed(1e3 * T[:3, 3], 5)},{listed(quaternion, 8)},{listed(conf, 0)},{none}]"
        lines.append(f"  CONST robtarget P{i}:={target};")
        names.append(f"    MoveL p{i},v100,z10,tDrill\\WObj:=table;")
    text = "\n".join([*lines, "  PROC main()", *names, "  ENDPROC", "ENDMODULE"])
    return text, "demo.mod"


def rapid_back(text):
    number = r"(-?[\d.]+)"
    six = r"\[" + ",".join([number] * 6) + r"\]"
    joints = re.findall(r"jointtarget j\d+:=\[" + six, text)
    seven = r"\[" + ",".join([number] * 3) + r"\],\[" + ",".join([number] * 4) + r"\]"
    values = np.array(re.findall(r"robtarget P\d+:=\[" + seven, text), dtype=float)
    turns = Rotation.from_quat(np.roll(values[:, 3:], -1, axis=1))
    return np.array(joints, dtype=float), values[:, :3] / 1e3, turns


def urscript(arm, degrees, poses):
    lines = ["def demo():", "  # p[1,2,3,4,5,6] \xf1"]
    tool = [*TOOL, *TOOL_TURN.as_rotvec()]
    lines.append(f"  set_tcp(p{listed(tool, 12)})")
    for q, T in zip(np.deg2rad(degrees), poses, strict=True):
        lines.append(f"  movej({listed(q, 8)}, a=1.4, v=1.05)")
        vector = Rotation.from_matrix(T[:3, :3]).as_rotvec()
        lines.append(f"  movel(p{listed([*T[:3, 3], *vector], 8)}, a=1.2, v=0.25)")
    return "\n".join([*lines, "end", "demo()"]), "demo.script"


def urscript_back(text):
    joints = [one.split(",") for one in re.findall(r"movej\(\[(.*?)\]", text)]
    values = np.array([one.split(",") for one in re.findall(r"movel\(p\[(.*?)\]", text)], float)
    turns = Rotation.from_rotvec(values[:, 3:])
    return np.rad2deg(np.array(joints, dtype=float)), values[:, :3], turns


def fanuc(arm, degrees, poses):
    lines = ["/PROG DEMO", "/ATTR", f"LINE_COUNT\t= {2 * len(poses)};", "/MN"]
    positions = []
    for i, (q, T) in enumerate(zip(degrees, poses, strict=True)):
        lines.append(f"{2 * i + 1:4d}:J P[{2 * i + 1}] 100% FINE    ;")
        lines.append(f"{2 * i + 2:4d}:L P[{2 * i + 2}] 500mm/sec FINE    ;")
        angles = [f"\tJ{j}= {x:9.3f} deg" for j, x in enumerate(q, 1)]
        positions += [f"P[{2 * i + 1}]{{", "   GP1:", "\tUF : 0, UT : 1,\t"]
        positions += [",".join(angles[:3]) + ",", ",".join(angles[3:]), "};"]
        ahead, longer = sides(arm, np.deg2rad(q))
        config = f"N {'U' if longer else 'D'} {'T' if ahead else 'B'}, 0, 0, 0"
        positions += [f'P[{2 * i + 2}:"hole"]{{', "   GP1:"]
        positions.append(f"\tUF : 3, UT : 1,\t\tCONFIG : '{config}',")
        x, y, z = 1e3 * T[:3, 3]
        w, p, r = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True)
        positions.append(f"\tX = {x:9.3f}  mm,\tY = {y:9.3f}  mm,\tZ = {z:9.3f}  mm,")
        positions += [f"\tW = {w:9.3f} deg,\tP = {p:9.3f} deg,\tR = {r:9.3f} deg", "};"]
    return "\r\n".join([*lines, "/POS", *positions, "/END", ""]), "demo.ls"


def fanuc_back(text):
    joints = [re.findall(r"J\d=\s*(\S+) deg", one) for one in text.split("};")]
    poses = [re.findall(r"[XYZWPR] =\s*(\S+)\s+(?:mm|deg)", one) for one in text.split("};")]
    values = np.array([one for one in poses if one], dtype=float)
    turns = Rotation.from_euler("xyz", values[:, 3:], degrees=True)
    return np.array([one for one in joints if one], dtype=float), values[:, :3] / 1e3, turns


BRANDS = {
    "krl": (krl, krl_back),
    "rapid": (rapid, rapid_back),
    "urscript": (urscript, urscript_back),
    "fanuc": (fanuc, fanuc_back),
}
# What a controller's digits leave of a place that is 4 m away, and of a turn: [m], [rad].
DIGITS = {
    "krl": (2e-5, 1e-5),
    "rapid": (2e-5, 1e-5),
    "urscript": (1e-5, 5e-6),
    "fanuc": (2e-4, 1e-4),
}


def random_poses(count, seed):
    """Poses in degrees, as the test's writers print them."""
    rng = np.random.default_rng(seed)
    low, high = np.rad2deg(ROBOT.limits)
    low, high = np.maximum(low + 5, -170), np.minimum(high - 5, 170)
    q = np.round(rng.uniform(low, high, (count, 6)), 3)
    q[:, 4] = np.where(np.abs(q[:, 4]) < 10, 40.0, q[:, 4])
    return q


def study_of(brand):
    """The study with the frames that a brand's program does not state itself."""
    base = placed(BASE, BASE_TURN)
    bases = {"3": base, "default": base} if brand == "urscript" else {"3": base}
    return STUDY.replace(frames={"tool": {"1": placed(TOOL, TOOL_TURN)}, "base": bases})


@pytest.mark.parametrize("brand", BRANDS)
@pytest.mark.cell("`compensate` a robot program", "springs")
def test_a_corrected_program_brings_the_loaded_tool_where_the_program_was_meant(
    tmp_path, arm, brand
):
    """In poses of all branches, joints and poses alike, up to the digits that controllers take."""
    writer, back = BRANDS[brand]
    degrees = random_poses(4, seed=len(brand))
    goals = places(arm, np.deg2rad(degrees))
    in_base = np.linalg.inv(homogeneous(BASE, BASE_TURN)) @ goals
    text, name = writer(arm, degrees, in_base)
    path = tmp_path / name
    path.write_bytes(text.encode("latin-1"))
    out = tmp_path / f"out{path.suffix}"
    found = edtk.compensate(study_of(brand), FOUND, path, out=out)
    assert found.left == ()
    assert len(found.targets) == 8

    corrected = out.read_bytes().decode("latin-1")
    joints, positions, turns = back(corrected)
    near = np.deg2rad(joints)
    commands = [*near]
    for q, position, turn in zip(near, positions, turns, strict=True):
        T = homogeneous(BASE, BASE_TURN) @ homogeneous(position, turn)
        commands.append(controller(arm, T, q))
    after = places(arm, np.array(commands), loaded=True)
    before = places(arm, np.deg2rad(degrees), loaded=True)
    goals = np.concatenate([goals, goals])
    length, angle = DIGITS[brand]
    off = np.linalg.norm(after[:, :3, 3] - goals[:, :3, 3], axis=1)
    turned = Rotation.from_matrix(after[:, :3, :3] @ np.swapaxes(goals[:, :3, :3], 1, 2))
    assert off.max() < length
    assert turned.magnitude().max() < angle
    assert np.linalg.norm(before[:, :3, 3] - goals[:4, :3, 3], axis=1).min() > 20 * length
    assert found.rounded.max() < length
    if brand == "fanuc":
        assert [*map(len, text.splitlines()[-40:])] == [*map(len, corrected.splitlines()[-40:])]

    # All else is as it was, byte for byte, but for a comment.
    number = r" *-?\d+\.\d+" if brand == "fanuc" else r"-?\d+\.\d+"  # whose fields have a width
    old, new = (re.sub(number, "#", one) for one in (text, corrected))
    mark = re.search(r"[^\r\n]*edtk [0-9a-f]{12} [0-9a-f]{12}[^\r\n]*(\r\n|\n)", new)
    new = new.replace(mark[0], "")
    assert new.replace("= 9;", "= 8;").rstrip("\n") == old.rstrip("\n")

    # A second time nothing moves.
    twice = tmp_path / f"twice{path.suffix}"
    again = edtk.compensate(study_of(brand), FOUND, out, out=twice)
    assert again.already
    assert twice.read_bytes() == out.read_bytes()
    with pytest.raises(edtk.UserError, match="by another result"):
        edtk.compensate(study_of(brand), {**FOUND, "q2": 2e-7}, out)


def test_a_correction_differs_from_that_of_a_corrected_program_by_the_second_order(tmp_path):
    """Without the comment, correcting again moves by as much again, up to the square of it."""
    degrees = random_poses(4, seed=3)
    lines = [", ".join(f"A{j} {x:.9f}" for j, x in enumerate(q, 1)) for q in degrees]
    text = "DEF demo()\n" + "".join(f"PTP {{{one}}}\n" for one in lines) + "END\n"
    path = tmp_path / "demo.src"
    motions = []
    for share in (1.0, 0.1):
        found = {name: share * k for name, k in FOUND.items()}
        path.write_text(text)
        once = edtk.compensate(STUDY, found, path)
        unmarked = re.sub(r"; corrected.*\n", "", once.text)
        path.write_text(unmarked)
        twice = edtk.compensate(STUDY, found, path)
        first = once.command - np.array([one.q for one in once.targets])
        second = twice.command - np.array([one.q for one in twice.targets])
        motions.append((np.abs(first).max(), np.abs(second - first).max()))
    (first, change), (first_10, change_10) = motions
    assert first == pytest.approx(10 * first_10)
    assert change < 5 * first**2
    assert change == pytest.approx(100 * change_10, rel=0.1)


def test_an_edited_program_is_not_taken_for_a_corrected_one(tmp_path):
    """Neither is it corrected again, nor left as if nothing had been changed."""
    path = tmp_path / "demo.src"
    path.write_text("DEF demo()\nPTP {A1 0,A2 -60,A3 60,A4 30,A5 30,A6 0}\nEND\n")
    edtk.compensate(STUDY, FOUND, path, out=tmp_path / "out.src")
    text = (tmp_path / "out.src").read_text()
    path.write_text(text.replace("PTP", "PTP {A1 5,A2 -60,A3 60,A4 30,A5 30,A6 0}\nPTP"))
    with pytest.raises(edtk.UserError, match="edited since"):
        edtk.compensate(STUDY, FOUND, path)


def test_the_table_says_what_moved(tmp_path):
    """In JSON, CSV and as text: lines, joints before and after, and millimetres."""
    path = tmp_path / "demo.src"
    path.write_text("DEF demo()\nPTP {A1 0,A2 -60,A3 60,A4 30,A5 30,A6 0}\nEND\n")
    found = edtk.compensate(STUDY, FOUND, path, table=tmp_path / "table.csv")
    told = json.loads(json.dumps(found.to_dict()))
    (target,) = told["targets"]
    assert (target["line"], target["kind"]) == (2, "joints")
    turned = np.array(target["corrected_q"]) - target["q"]
    commands = edtk.compensate(STUDY, FOUND)
    assert turned == pytest.approx((commands.command - commands.desired)[0])
    header = (tmp_path / "table.csv").read_text().splitlines()[0]
    assert header.startswith(
        "line,target,kind,moved_mm,turned_deg,rounded_mm,error_before_mm,q1_deg"
    )
    assert "1 target corrected by up to" in found.summary()
    assert "<table" in found._repr_html_()
    assert target["moved"] == pytest.approx(told["uncompensated"][0], rel=0.02)

"""What readers of programs take for targets, and what they leave, with its line."""

from pathlib import Path
from time import process_time

import numpy as np
import pytest
from click.testing import CliRunner

import edtk
from edtk.calibration.correct_program import brand_of
from edtk.cli import main
from edtk.programs.program import Move, Program, axes_of
from edtk.programs.targets.reading import Frames, targets_of
from edtk.programs.writer import get

FOUND = {"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6, "q6": 2.1e-6}
TOOL = {"position_mm": [986, 0, 0]}
STUDY = edtk.Study(
    robot="kuka_kr270",
    tool={"position_mm": [611.5, 0, -460]},
    load={"F_N": [0, 0, -2500]},
    measurement={"sigma_mm": 0.03},
    joints={"unknown": list(FOUND)},
    test_pose={"q_deg": [0, -60, 60, 30, 30, 0], "tool": TOOL, "load": {"F_N": [0, 0, -2500]}},
    frames={"tool": {"1": TOOL, "tDrill": TOOL}, "base": {"1": {"position_mm": [0, 0, 0]}}},
)
J = "A1 5,A2 -60,A3 60,A4 30,A5 30,A6 10"
P = "X 1900,Y 200,Z 1300,A 30,B 60,C 10"
SET = "$TOOL=TOOL_DATA[1]\n$BASE=$NULLFRAME\n"
NONE = "[9E9,9E9,9E9,9E9,9E9,9E9]"
RJ = f"[[5,-60,60,30,30,10],{NONE}]"
QUATERNION = "[0.85,0.2,0.45,0.19]"
RP = f"[[1900,200,1300],[0.827,0.185,0.5,0.178],[0,-1,0,0],{NONE}]"
LOAD = "[1,[0,0,1],[1,0,0,0],0,0,0]"


def corrected(folder: Path, name: str, text: str, every: bool = False) -> edtk.CorrectedProgram:
    """A program as it is corrected."""
    path = folder / name
    path.write_bytes(text.encode("latin-1"))
    found = edtk.compensate(STUDY, FOUND, path, all_literals=every)
    assert isinstance(found, edtk.CorrectedProgram)
    return found


def lines(found: edtk.CorrectedProgram) -> list[int]:
    """Lines of the targets that are corrected."""
    return [one.target.literal.line for one in found.targets]


def left(found: edtk.CorrectedProgram) -> dict[int, str]:
    """Reasons by lines of what is left."""
    return {one.line: one.reason for one in found.left}


LEFT_KRL = {
    f"IF a==1 THEN\nPTP {{{J}}}\nENDIF": "a conditional (line 3)",
    f"FOR i=1 TO 3\nPTP {{{J}}}\nENDFOR": "a loop (line 3)",
    f"LOOP\nPTP {{{J}}}\nENDLOOP": "a loop (line 3)",
    f"SWITCH a\nCASE 1\nPTP {{{J}}}\nENDSWITCH": "a conditional (line 3)",
    f"again:\nPTP {{{J}}}\nGOTO again": "the reach of the GOTO of line 5",
    "PTP {A1 10}": "states no A2, A3, A4, A5, A6",
    f"PTP {{{J.replace('30', 'angle', 1)}}}": "A4 is computed at run time",
    "LIN_REL {X 10}": "is relative to the point before it",
    f"LIN {{{P}}}": "no tool is stated before it",
    f"$TOOL=TOOL_DATA[7]\n$BASE=BASE_DATA[1]\nLIN {{{P}}}": "tool TOOL_DATA[7] is not known",
    f"{SET}$TOOL.X=3\nLIN {{{P}}}": "the tool is computed at run time",
    f"{SET}$IPO_MODE=#TCP\nLIN {{{P}}}": "the tool stands still",
    f"{SET}IF a THEN\n$TOOL=TOOL_DATA[2]\nENDIF\nLIN {{{P}}}": "set in a conditional or a loop",
    f"{SET}LIN {{{P.replace('1900', '9000')}}}": "is out of reach",
    f"{SET}PTP {{{P},S 7,T 63}}": "on the branch",
    f"p1={{{J}}}\nPTP p1\np1.A2=p1.A2+1": "line 5 changes it at run time",
    f"p1={{E6AXIS: {J}}}\nPTP p1\nx=p1.A2": "line 5 computes with it",
    f"p1={{{P}}}\nPTP p1:{{X 10}}": "is computed at run time",
    f"{SET}p1={{{P}}}\nLIN p1\n$BASE=BASE_DATA[1]\n$TOOL=$NULLFRAME\nLIN p1": "different tools",
    "PTP elsewhere": "is not declared here",
    f"PTP {{{J.replace('-60', '170')}}}": "outside the joint's limits",
}


@pytest.mark.parametrize("body", LEFT_KRL)
def test_what_krl_does_at_run_time_is_left(tmp_path: Path, body: str) -> None:
    """Beside a target that is corrected, each is left as it is, and listed for its reason."""
    text = f"DEF demo()\nPTP {{{J}}}\n{body}\nEND\n"
    found = corrected(tmp_path, "demo.src", text)
    assert lines(found) == [2]
    (reason,) = set(left(found).values())
    assert LEFT_KRL[body] in reason
    old, new = text.splitlines(), found.text.splitlines()
    assert new[2:-2] == old[2:-1]
    assert "; corrected by edtk" in new[-2]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_all_literals_of_krl_are_corrected_when_asked(tmp_path: Path, end: str) -> None:
    """Those in loops, and those that something is computed with; not those that change."""
    body = ["DEF demo()", "LOOP", f"PTP {{{J}}}", "ENDLOOP", f"p1={{E6AXIS: {J}}}", "PTP p1"]
    body += ["x=p1.A2", f"p2={{{J}}}", "PTP p2", "p2.A1=3", "END", ""]
    found = corrected(tmp_path, "demo.src", end.join(body), every=True)
    assert lines(found) == [3, 5]
    assert list(left(found)) == [8]
    assert found.text.count(end) == len(body)


def test_a_frame_that_a_loop_sets_to_what_it_is_stays_known(tmp_path: Path) -> None:
    """In the loop and behind it."""
    text = f"DEF demo()\n{SET}LOOP\n$TOOL=TOOL_DATA[1]\nLIN {{{P}}}\nENDLOOP\nLIN {{{P}}}\nEND\n"
    assert lines(corrected(tmp_path, "demo.src", text, every=True)) == [6, 8]
    assert lines(corrected(tmp_path, "demo.src", text)) == [8]


def test_the_poses_of_krl_know_the_motions_beside_them(tmp_path: Path) -> None:
    """A .dat file has frames by its FDAT, and what the .src file does with its points."""
    src = "DEF demo()\nPTP XP1\nLIN XP2\nLIN XP4\nXP2.X=XP2.X+10\nLOOP\nPTP XP3\nENDLOOP\nEND\n"
    (tmp_path / "demo.src").write_text(src)
    frames = "TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE"
    dat = [f"DECL E6POS XP{i}={{{P},S 2,T 2,E1 0}}" for i in (1, 2, 3, 4)]
    dat += [f"DECL FDAT FP{i}={{{frames}}}" for i in (1, 2, 3)]
    dat.append(f"DECL FDAT FP4={{{frames.replace('#BASE', '#TCP')}}}")
    dat.append("DECL PDAT PP1={VEL 100,ACC 100}")
    text = "\n".join(["DEFDAT demo", *dat, "ENDDAT", ""])
    found = corrected(tmp_path, "demo.dat", text)
    assert lines(found) == [2]
    assert "line 5 changes it" in left(found)[3]
    assert "a loop (line 6)" in left(found)[4]
    assert "stands still" in left(found)[5]
    with pytest.raises(edtk.UserError, match=r"XP1: is declared in demo.dat; correct that file"):
        edtk.compensate(STUDY, FOUND, tmp_path / "demo.src")


LEFT_RAPID = {
    "MoveL Offs(p1,0,0,100),v100,fine,tDrill;": {3: "line 7 computes with it", 7: "at run time"},
    "IF a=1 THEN\nMoveL p1,v100,fine,tDrill;\nENDIF": {3: "a conditional (line 7)"},
    "IF a=1 MoveL p1,v100,fine,tDrill;": {3: "a conditional (line 7)"},
    "WHILE TRUE DO\nMoveL p1,v100,fine,tDrill;\nENDWHILE": {3: "a loop (line 7)"},
    "FOR i FROM 1 TO 3 DO\nMoveL p1,v100,fine,tDrill;\nENDFOR": {3: "a loop (line 7)"},
    "TEST a\nCASE 1:\nMoveL p1,v100,fine,tDrill;\nENDTEST": {3: "a conditional (line 7)"},
    "p1.trans.x := 3;\nMoveL p1,v100,fine,tDrill;": {3: "line 7 changes it"},
    "MoveL p1,v100,fine,tOther;": {3: "tool TOTHER is not known"},
    "MoveL p1,v100,fine,tDrill\\WObj:=wobj7;": {3: "base WOBJ7 is not known"},
    "MoveL p1,v100,fine,tHeld;": {3: "stands still"},
    "tOwn.tframe.trans.x:=3;\nMoveL p1,v100,fine,tOwn;": {3: "line 7 changes TOWN"},
    "MoveL p1,v100,fine,tDrill;\nMoveL p1,v100,fine,tool0;": {3: "different tools"},
    "PDispSet pd;\nMoveL p1,v100,fine,tDrill;": {3: "displaces all targets"},
    "MoveL elsewhere,v100,fine,tDrill;": {3: "no tool is stated", 7: "is not declared here"},
}


@pytest.mark.parametrize("body", LEFT_RAPID)
def test_what_rapid_does_at_run_time_is_left(tmp_path: Path, body: str) -> None:
    """Beside joints that are corrected, each pose is left as it is, for its reason."""
    tool = f"tooldata tOwn:=[TRUE,[[1,2,3],[1,0,0,0]],{LOAD}];"
    held = f"tooldata tHeld:=[FALSE,[[1,2,3],[1,0,0,0]],{LOAD}];"
    head = ["MODULE demo", f"CONST jointtarget j1:={RJ};", f"CONST robtarget p1:={RP};"]
    head += [f"PERS {tool}", f"PERS {held}", "PROC main() MoveAbsJ j1,v100,fine,tool0;"]
    text = "\n".join([*head, body, "ENDPROC", "ENDMODULE"])
    found = corrected(tmp_path, "demo.mod", text)
    assert lines(found) == [2]
    told = left(found)
    assert list(told) == list(LEFT_RAPID[body])
    assert all(words in told[line] for line, words in LEFT_RAPID[body].items())


LEFT_UR = {
    "if a == 1:\n movej(q1)\nend": {2: "a conditional (line 4)"},
    "while True:\n movej(q1)\nend": {2: "a loop (line 4)"},
    "movej([d2r(10),0,0,0,0,0])": {4: "is computed at run time"},
    "movej(get_inverse_kin(p[1,0,1,0,0,0]))": {4: "is computed at run time"},
    "movel(pose_add(p1, p[0,0,0.1,0,0,0]))": {4: "is computed at run time"},
    "movel(p[1.9,0,1.1,0,1,0])": {4: "no tool is stated"},
    "set_tcp(f())\nmovel(p[1.9,0,1.1,0,1,0])": {5: "the tool is computed at run time"},
    "q1[2]=0.3\nmovej(q1)": {2: "line 4 changes it"},
    "movej([0,0,0])": {4: "has 3 numbers; expected 6"},
    "movej(other)": {4: "is not declared here"},
}


@pytest.mark.parametrize("body", LEFT_UR)
def test_what_urscript_does_at_run_time_is_left(tmp_path: Path, body: str) -> None:
    """Beside joints that are corrected."""
    text = f"def demo():\nq1=[0.1,-1,1,0.5,0.5,0.1]\nmovej([0.1,-1,1,0.5,0.5,0.1])\n{body}\nend\n"
    found = corrected(tmp_path, "demo.script", text)
    assert lines(found) == [3]
    told = left(found)
    assert list(told) == list(LEFT_UR[body])
    assert all(words in told[line] for line, words in LEFT_UR[body].items())


LEFT_LS = {
    "2:J P[2] 100% FINE Offset,PR[1] ;": "line 4 computes with it",
    "2:J PR[2] 100% FINE ;": "is a register",
    "2:J P[R[2]] 100% FINE ;": "is chosen at run time",
    "2:  LBL[1] ;\n3:J P[2] 100% FINE ;\n4:  JMP LBL[1] ;": "the reach of the JMP of line 6",
    "2:  IF (R[1]=1) THEN ;\n3:J P[2] 100% FINE ;\n4:  ENDIF ;": "a conditional (line 4)",
    "2:  FOR R[1]=1 TO 3 ;\n3:J P[2] 100% FINE ;\n4:  ENDFOR ;": "a loop (line 4)",
    "2:L P[3] 100mm/sec FINE ;": "base 9 is not known",
    "2:L P[4] 100mm/sec FINE ;": "has turn numbers other than 0",
    "2:L P[5] 100mm/sec FINE ;": "has not all its numbers",
}


@pytest.mark.parametrize("body", LEFT_LS)
def test_what_fanuc_does_at_run_time_is_left(tmp_path: Path, body: str) -> None:
    """Beside joints that are corrected."""
    joints = ", ".join(f"J{i}= {x:9.3f} deg" for i, x in enumerate([5, -60, 60, 30, 30, 10], 1))
    place = "X = 1900.000 mm, Y = 200.000 mm, Z = 1300.000 mm, W = 10.000 deg, P = 60.000 deg,"
    pose = f"{place} R = 30.000 deg"
    positions = {
        1: f"UF : 0, UT : 1, {joints}",
        2: f"UF : 0, UT : 1, {joints}",
        3: f"UF : 9, UT : 1, CONFIG : 'N U T, 0, 0, 0', {pose}",
        4: f"UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 1', {pose}",
        5: "UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = ******** mm",
    }
    used = [one for one in positions if one == 1 or f"P[{one}]" in body]
    data = "\n".join(f"P[{one}]{{\n GP1:\n {positions[one]}\n}};" for one in used)
    text = f"/PROG A\n/MN\n1:J P[1] 100% FINE ;\n{body}\n/POS\n{data}\n/END\n"
    found = corrected(tmp_path, "demo.ls", text)
    assert [one.target.literal.name for one in found.targets] == ["P[1]"]
    assert any(LEFT_LS[body] in one for one in left(found).values())


WRONG = {
    "a.src": ("q1_deg,q2_deg\n0,1\n", "is no program in KUKA KRL"),
    "b.ls": ("\xff\xfe/\0P\0R\0O\0G\0", "is no program in FANUC LS"),
    "c.mod": ("MODULE a\nENDMODULE\n", "has no targets"),
    "d.script": (
        "def a():\nmovej(x)\nend\n",
        "no target can be corrected: line 2: x: is not declared here",
    ),
    "e.src": (f"DEF a()\nLIN {{{P}}}\nPTP x\nEND\n", "(and 1 more)"),
    "f.src": (f"DEF a()\nPTP {{{J.replace('-60', '170')}}}\nEND\n", "outside the joint's limits"),
}


@pytest.mark.parametrize("name", WRONG)
def test_programs_of_which_nothing_can_be_corrected_write_nothing(
    tmp_path: Path, name: str
) -> None:
    """One line, the exit code 2, and no file."""
    text, words = WRONG[name]
    program = tmp_path / name
    program.write_bytes(text.encode("latin-1"))
    study, k, out = tmp_path / "study.toml", tmp_path / "k.json", tmp_path / "out.txt"
    STUDY.to_toml(study)
    k.write_text('{"k": {"q2": 3e-7, "q3": 4e-7, "q4": 3e-6, "q5": 3e-6, "q6": 2e-6}}')
    given = ["compensate", *map(str, (study, k, program)), "--out", str(out)]
    done = CliRunner().invoke(main, given)
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
    assert not out.exists()


def test_what_is_left_ends_with_code_1_and_a_line_each(tmp_path: Path) -> None:
    """The program is written, and standard error says what is left; poses have no table."""
    study, k, out = tmp_path / "study.toml", tmp_path / "k.json", tmp_path / "out.src"
    STUDY.to_toml(study)
    k.write_text('{"k": {"q2": 3e-7, "q3": 4e-7, "q4": 3e-6, "q5": 3e-6, "q6": 2e-6}}')
    program = tmp_path / "a.src"
    program.write_text(f"DEF a()\nPTP {{{J}}}\nPTP x\nPTP y\nEND\n")
    given = ["compensate", *map(str, (study, k, program))]
    done = CliRunner().invoke(main, [*given, "--out", str(out)])
    assert done.exit_code == 1
    assert done.stderr.splitlines() == [
        f"edtk: {program}: line 3: X: is not declared here",
        f"edtk: {program}: line 4: Y: is not declared here",
    ]
    assert out.exists()
    done = CliRunner().invoke(main, [*given, "--out", str(program)])
    assert done.exit_code == 2
    assert "is read by this command" in done.stderr
    done = CliRunner().invoke(main, ["compensate", str(study), str(k), "--table", str(out)])
    assert done.exit_code == 2
    assert "is for robot programs" in done.stderr


def test_a_turn_that_crosses_zero_is_written(tmp_path: Path) -> None:
    """S and T follow the corrected joints: else a controller would go there by a whole turn."""
    task = {"q_deg": [0, -60, 60, 30, 30, 0], "tool": TOOL, "load": {"F_N": [0, 900, 0]}}
    study = STUDY.replace(test_pose=task)
    robot = study.robot.with_tool(study.specification.frames.build().tools["1"])
    found = []
    for angle, turn in ((1e-3, 2), (-1e-3, 10)):
        T = robot.forward(np.deg2rad([5.0, -60, 80, angle, 60, 90]))
        x, y, z = 1e3 * T[:3, 3]
        a = np.rad2deg(np.arctan2(T[1, 0], T[0, 0]))
        b = np.rad2deg(np.arctan2(-T[2, 0], np.hypot(T[0, 0], T[1, 0])))
        c = np.rad2deg(np.arctan2(T[2, 1], T[2, 2]))
        pose = f"X {x:.6f},Y {y:.6f},Z {z:.6f},A {a:.8f},B {b:.8f},C {c:.8f}"
        path = tmp_path / "demo.src"
        path.write_text(f"DEF demo()\n{SET}PTP {{{pose},S 2,T {turn}}}\nEND\n")
        one = edtk.compensate(study, FOUND, path)
        assert isinstance(one, edtk.CorrectedProgram)
        bits = sum(2**j for j, value in enumerate(one.command[0]) if value < 0)
        assert f"S 2,T {bits}}}" in one.text
        found.append(bits)
    assert found in ([2, 2], [10, 10])


def test_targets_are_what_the_controller_shows(tmp_path: Path) -> None:
    """With signs, zeros and axes that follow others, joints move as those of a table of poses."""
    controller = {"sign": {"q1": -1}, "zero_deg": {"q6": 20}, "follows": {"q3": "q2"}}
    study = STUDY.replace(controller=controller)
    shown = [-5.0, -60.0, 50.0, 30.0, 40.0, -12.0]
    table = tmp_path / "task.csv"
    table.write_text(
        ",".join(f"q{i}_deg" for i in range(1, 7)) + "\n" + ",".join(map(str, shown)) + "\n"
    )
    commands = edtk.compensate(study, FOUND, table)
    expected = np.rad2deg(study.robot.shown(commands.command[0]))

    robot = study.robot.with_tool(study.specification.frames.build().tools["1"])
    T = robot.forward(study.robot.of_shown(np.deg2rad(shown)))
    x, y, z = 1e3 * T[:3, 3]
    a = np.rad2deg(np.arctan2(T[1, 0], T[0, 0]))
    b = np.rad2deg(np.arctan2(-T[2, 0], np.hypot(T[0, 0], T[1, 0])))
    c = np.rad2deg(np.arctan2(T[2, 1], T[2, 2]))
    turn = sum(2**j for j, value in enumerate(shown) if value < 0)
    joints = ",".join(f"A{j} {value}" for j, value in enumerate(shown, 1))
    pose = f"X {x:.6f},Y {y:.6f},Z {z:.6f},A {a:.8f},B {b:.8f},C {c:.8f}"
    path = tmp_path / "demo.src"
    path.write_text(f"DEF demo()\nPTP {{{joints}}}\n{SET}PTP {{{pose},T {turn}}}\nEND\n")
    found = edtk.compensate(study, FOUND, path)
    assert isinstance(found, edtk.CorrectedProgram)
    (line,) = [one for one in found.text.splitlines() if one.startswith("PTP {A1")]
    written = [float(one.split()[1]) for one in line[5:-1].split(",")]
    assert np.abs(written - expected).max() < 6e-5
    assert np.abs(np.rad2deg(study.robot.shown(found.command)) - expected).max() < 1e-5


@pytest.mark.parametrize("name", ["krl", "rapid", "urscript", "fanuc_ls"])
def test_programs_that_edtk_writes_are_corrected(tmp_path: Path, name: str) -> None:
    """Each pose of a written program is found, as the writer rounded it."""
    axes = axes_of([f"q{i}" for i in range(1, 7)], ["revolute"] * 6)
    degrees = np.array([[5, -60, 60, 30, 30, 10], [-20, -90, 80, 10, 60.5, 0.125]])
    writer = get(name)
    units = writer.taken(degrees, axes)
    steps = tuple(Move(tuple(map(float, one)), (i, i)) for i, one in enumerate(units, 1))
    texts = writer.write(Program("demo", axes, steps))
    for suffix, text in texts.items():
        (tmp_path / f"demo{suffix}").write_text(text)
    path = tmp_path / f"demo{'.dat' if '.dat' in texts else next(iter(texts))}"
    found = edtk.compensate(STUDY, FOUND, path)
    assert isinstance(found, edtk.CorrectedProgram)
    assert found.left == ()
    nominal = np.rad2deg([one.q for one in found.targets])
    assert np.abs(nominal - degrees).max() < 1e-3


def test_rapid_moves_of_all_forms_are_read(tmp_path: Path) -> None:
    """Literals in moves, arcs, outputs at the end of a move, options, and a byte-order mark."""
    pose = f"[[1900,200,1300],[0.827,0.185,0.5,0.178],[0,-1,0,0],{NONE}]"
    other = pose.replace("1900", "1850")
    moves = [
        f"MoveAbsJ {RJ}\\NoEOffs,v100,fine,tool0;",
        f"MoveJ {pose},v100,fine,tDrill;",
        f"MoveC {pose},{other},v100,\n z10,tDrill\\WObj:=wobj0;",
        f"MoveLDO \\Conc,{pose},v100,z10,tDrill,do1,1;",
    ]
    head = "\xef\xbb\xbfMODULE demo\nPROC main()\n"
    text = head + "\n".join(moves) + "\nENDPROC\nENDMODULE\n"
    found = corrected(tmp_path, "demo.mod", text)
    assert lines(found) == [3, 4, 5, 5, 7]
    assert found.left == ()
    assert found.content.startswith(head.encode("latin-1"))


def test_the_first_move_of_rapid_stands_behind_parameters_of_any_number(tmp_path: Path) -> None:
    """Its parentheses end where they are closed."""
    given = ",".join(f"num given{i}" for i in range(200))
    move = f"MoveAbsJ {RJ}\\NoEOffs,v100,fine,tool0;"
    text = f"MODULE demo\nPROC main({given})\n{move}\nENDPROC\nENDMODULE\n"
    found = corrected(tmp_path, "demo.mod", text)
    assert lines(found) == [3]
    assert found.left == ()


def test_arcs_of_fanuc_have_a_second_line(tmp_path: Path) -> None:
    """The end of an arc stands in the line behind, and registers there are named."""
    joints = ", ".join(f"J{i}= {x:9.3f} deg" for i, x in enumerate([5, -60, 60, 30, 30, 10], 1))
    arc = (
        "1:C P[1]    \n    :  P[2] 100mm/sec FINE    ;\n2:C P[3]    \n    :  PR[4] 100mm/sec FINE ;"
    )
    data = "\n".join(f"P[{one}]{{\n GP1:\n UF : 0, UT : 1, {joints}\n}};" for one in (1, 2, 3))
    found = corrected(tmp_path, "demo.ls", f"/PROG A\n/MN\n{arc}\n/POS\n{data}\n/END\n")
    assert [one.target.literal.name for one in found.targets] == ["P[1]", "P[2]", "P[3]"]
    assert left(found) == {6: "is a register, which the program does not hold"}


PROGRAMS = {
    "a.src": [f"DEF demo()\n{SET}PTP {{{J}}}\n{body}\nEND\n" for body in LEFT_KRL],
    "a.mod": [
        f"MODULE m\nCONST robtarget p1:={RP};\nPROC main() MoveAbsJ {RJ},v1,fine,tool0;\n{body}\n"
        "ENDPROC\nENDMODULE\n"
        for body in LEFT_RAPID
    ],
    "a.script": [f"def demo():\nq1=[0,-1,1,0,0,0]\n{body}\nend\n" for body in LEFT_UR],
    "a.ls": [
        f"/PROG A\n/MN\n{body}\n/POS\nP[2]{{\n GP1:\n UF : 0, UT : 1, J1= 1 deg\n}};\n/END\n"
        for body in LEFT_LS
    ],
}
SPLINTERS = ["{", "}", "[", "]", "(", ")", ",", ";", "IF ", "ENDIF", "\\", ":=", '"', "!", "GOTO x"]
SPLINTERS += [
    "P[1]",
    "/POS",
    "{A1 1}",
    "1e999",
    "-",
    "\n",
    "\r",
    "JMP LBL[1]",
    "p[",
    "\xe9",
    "end\n",
]


@pytest.mark.parametrize("name", PROGRAMS)
def test_broken_programs_are_read_without_an_error(name: str) -> None:
    """Whatever is cut out or put in, numbers of targets stand where the reader says."""
    rng = np.random.default_rng(0)
    axes = axes_of([f"q{i}" for i in range(1, 7)], ["revolute"] * 6)
    brand = brand_of(name)
    assert brand is not None
    for i in range(150):
        text = PROGRAMS[name][i % len(PROGRAMS[name])]
        for at in rng.integers(0, len(text), 3):
            cut = int(at + rng.integers(0, 8))
            text = text[:at] + SPLINTERS[int(rng.integers(len(SPLINTERS)))] + text[cut:]
        targets, _ = targets_of(brand.read(text, axes, Frames(), {}), bool(i % 2))
        for target in targets:
            for number in (*target.literal.joints.values(), *target.literal.pose):
                assert text[number.start : number.end] == number.text
                assert abs(number.value) < 1e11


# What a reader goes through again from every place of a text, if its patterns are careless.
REPEATED = {
    "a.ls": [" ", "\n", "/PROG\n/MN\n", "P[", "P[1:", "1:J P[ ", "JMP LBL[ ", "IF (", "P[1]{X= "],
    "a.src": [" ", "\n", "LIN a C_A ", "DECL ", "A ", "FOR "],
    "a.mod": [" ", "\n", "IF ", "GOTO a;a:", "PROC a(", "VAR robtarget a ", "{"],
    "a.script": [" ", "\n", "a ", "a[", "def "],
}
BEGIN = {"a.ls": "/PROG A\n/MN\n", "a.src": "DEF a()\nLIN a", "a.mod": "MODULE a\n", "a.script": ""}


def read_in(name: str, text: str) -> float:
    """Processor time to look for a program in a text, and to read it [s]."""
    axes = axes_of([f"q{i}" for i in range(1, 7)], ["revolute"] * 6)
    brand = brand_of(name)
    assert brand is not None
    since = process_time()
    brand.content.search(text)
    targets_of(brand.read(text, axes, Frames(), {}), every=True)
    return process_time() - since


@pytest.mark.parametrize("name", REPEATED)
def test_the_time_to_read_a_program_grows_with_its_length(name: str) -> None:
    """Not with a power of it: 30,000 blanks in a line took hours."""
    for part in REPEATED[name]:
        assert read_in(name, BEGIN[name] + part * (30_000 // len(part)) + "\n") < 1.5, part


def test_many_targets_are_told_their_lines_at_once() -> None:
    """A program of RAPID with 20,000 targets took many minutes, to count lines for each anew."""
    lines = [f"CONST robtarget p{i}:={RP};" for i in range(200)]
    text = "\n".join(["MODULE a", *["! nothing"] * 100_000, *lines, "ENDMODULE\n"])
    assert read_in("a.mod", text) < 3.0


# Lines that a program may have a thousand times: frames that change, blocks, calls and routines.
OFTEN = {
    "a.src": [
        f"IF a THEN\n$TOOL=TOOL_DATA[1]\nLIN {{{P}}}\nENDIF\n",
        f"$TOOL={{{P}}}\n$BASE=$NULLFRAME\nLIN {{{P}}}\n",
        f"LIN {{{P}}}\nGOTO b\n",
        f"f()\nLIN {{{P}}}\nEND\nDEF f()\n$BASE=$NULLFRAME\n",
    ],
    "a.script": [
        "if a:\nset_tcp(p[0,0,0,0,0,0])\nmovel(p[0,0,0,0,0,0])\nend\n",
        "b=p[0,0,0,0,0,0]\nset_tcp(b)\nmovel(b)\n",
        "movel(p[0,\n",
    ],
}


@pytest.mark.parametrize("name", OFTEN)
def test_a_thousand_frames_blocks_and_routines_are_read_at_once(name: str) -> None:
    """Frames of each motion were sought from the beginning: a thousand blocks took 45 s."""
    for part in OFTEN[name]:
        assert read_in(name, BEGIN[name] + "\n" + part * 1000) < 1.5, part


def test_a_call_of_several_lines_is_read_once(tmp_path: Path) -> None:
    """Lines of a move in URScript had counted as others that compute with its target."""
    move = "movel(\n p1,\n a=1.2)"
    text = f"def demo():\nset_tcp(p[0,0,0,0,0,0])\np1=p[1.9,0,1.1,0,1,0]\n{move} x=p2\nend\n"
    assert lines(corrected(tmp_path, "demo.script", text)) == [3]


def test_routines_that_set_tools_make_them_unknown_behind_calls(tmp_path: Path) -> None:
    """In KRL also by way of others; a routine without a tool of its own has its caller's."""
    line = f"LIN {{{P}}}"
    main = ["DEF demo()", *SET.splitlines(), line, "harmless()", line, "outer()", line, "END"]
    outer = ["DEF outer()", "inner()", "END", "DEF inner()", "$TOOL=TOOL_DATA[1]", "END"]
    harmless = ["DEF harmless()", line, "END"]
    found = corrected(tmp_path, "demo.src", "\n".join([*main, *outer, *harmless, ""]))
    assert lines(found) == [4, 6]
    told = left(found)
    assert told == {
        8: "OUTER sets the tool before it",
        17: "the tool is that of the calling routine",
    }
    function = "def tcp():\n set_tcp(p[0.1,0,0,0,0,0])\nend"
    move = "movel(p[1.9,0,1.1,0,1,0])"
    text = f"def demo():\nset_tcp(p[0,0,0,0,0,0])\n{move}\n{function}\n{move}\nend\n"
    found = corrected(tmp_path, "demo.script", text)
    assert lines(found) == [3]
    assert list(left(found)) == [7]

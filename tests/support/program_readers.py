"""Readers of robot programs for tests: strict, and without anything of the writers.

Each turns the text of a brand into a name and steps: ("rows", first, last), ("move", values by
axis), ("dwell", seconds), ("stop",) and ("ask", output, input). A line that it does not know is an
error, as it would be on the controller.
"""

import csv
import math
import re
from collections.abc import Callable, Iterator

Steps = list[tuple[object, ...]]
NUMBER = r"-?\d+\.\d+"


def _rows(comment: str) -> Steps:
    found = re.search(r"\brows? (\d+)(?: to (\d+))?$", comment)
    return [("rows", int(found[1]), int(found[2] or found[1]))] if found else []


def read_krl(files: dict[str, str]) -> tuple[str, Steps]:
    """A .src file with its .dat file."""
    source = files[".src"].splitlines()
    data = files[".dat"].splitlines()
    for header in (source, data):
        assert header[:2] == ["&ACCESS RVP", "&REL 1"]
    name = re.fullmatch(r"DEF (\w{1,24}) \( \)", source[2])[1]
    assert data[2] == f"DEFDAT {name}"
    assert (source[-1], data[-1]) == ("END", "ENDDAT")
    poses = {}
    for line in data[4:-1]:
        key, values = re.fullmatch(r"  DECL E6AXIS (\w{1,24})=\{(.+)\}", line).groups()
        pairs = (cell.split(" ") for cell in values.split(","))
        poses[key] = {axis: float(value) for axis, value in pairs}
        assert all(re.fullmatch("[AE][1-6]", axis) for axis in poses[key])
        assert len(key) <= 24
    return name, list(_krl_steps([line.strip() for line in source[3:-1]], poses))


def _krl_steps(lines: list[str], poses: dict[str, dict[str, float]]) -> Iterator[tuple]:
    while lines:
        line = lines.pop(0)
        if line.startswith(";"):
            yield from _rows(line)
        elif line.startswith("PTP "):
            yield "move", poses[line[4:]]
        elif line.startswith("WAIT SEC "):
            yield "dwell", float(line[9:])
        elif line == "HALT":
            yield ("stop",)
        elif found := re.fullmatch(r"\$OUT\[(\d+)\]=TRUE", line):
            rest = [lines.pop(0) for _ in range(3)]
            done = re.fullmatch(r"WAIT FOR \$IN\[(\d+)\]", rest[0])[1]
            assert rest[1:] == [f"$OUT[{found[1]}]=FALSE", f"WAIT FOR NOT $IN[{done}]"]
            yield "ask", found[1], done
        else:
            assert re.fullmatch(r"BAS \(#(INITMOV|VEL_PTP),[\d.]+ \)", line), line


def read_rapid(files: dict[str, str]) -> tuple[str, Steps]:
    """A module."""
    lines = [line.strip() for line in files[".mod"].splitlines() if line.strip()]
    name = re.fullmatch(r"MODULE (\w{1,32})", lines[0])[1]
    assert lines[-2:] == ["ENDPROC", "ENDMODULE"]
    poses: dict[str, dict[str, float]] = {}
    steps: Steps = []
    body = lines[1:-2]
    while body:
        line = body.pop(0)
        target = re.fullmatch(
            r"LOCAL CONST jointtarget (\w{1,32}) := \[\[(.+?)\],\[(.+?)\]\];", line
        )
        if target:
            robot, beside = target[2].split(","), target[3].split(",")
            assert (len(robot), len(beside)) == (6, 6)
            numbered = {str(i): float(x) for i, x in enumerate(robot, 1)}
            external = {f"E{i}": float(x) for i, x in enumerate(beside, 1) if x != "9E+09"}
            poses[target[1]] = numbered | external
        elif line.startswith("!"):
            steps += _rows(line)
        elif found := re.fullmatch(r"MoveAbsJ (\w+)\\NoEOffs, vmax, fine, tool0;", line):
            steps.append(("move", poses[found[1]]))
        elif found := re.fullmatch(rf"WaitTime\\InPos, ({NUMBER});", line):
            steps.append(("dwell", float(found[1])))
        elif line == "Stop;":
            steps.append(("stop",))
        elif found := re.fullmatch(r"SetDO (\w+), 1;", line):
            rest = [body.pop(0) for _ in range(3)]
            done = re.fullmatch(r"WaitDI (\w+), 1;", rest[0])[1]
            assert rest[1:] == [f"SetDO {found[1]}, 0;", f"WaitDI {done}, 0;"]
            steps.append(("ask", found[1], done))
        else:
            known = r'TPWrite "[^"\\]{0,80}";|VelSet [\d.]+, 5000;|PROC (\w{1,32})\(\)'
            found = re.fullmatch(known, line)
            assert found, line
            assert found[1] != name
    return name, steps


def read_urscript(files: dict[str, str]) -> tuple[str, Steps]:
    """A function; joints are returned in degrees."""
    lines = [line.rstrip() for line in files[".script"].splitlines()]
    while lines[0].startswith("#"):
        lines.pop(0)
    name = re.fullmatch(r"def (\w+)\(\):", lines[0])[1]
    assert lines[-1] == "end"
    body = [line.strip() for line in lines[1:-1]]
    steps: Steps = []
    while body:
        line = body.pop(0)
        if line.startswith("#"):
            steps += _rows(line)
        elif found := re.fullmatch(rf"movej\(\[(.+)\], a=({NUMBER}), v=({NUMBER})\)", line):
            radians = [float(value) for value in found[1].split(", ")]
            assert len(radians) == 6
            assert 0 < float(found[3]) <= math.pi
            values = {str(i): math.degrees(value) for i, value in enumerate(radians, 1)}
            steps.append(("move", values))
        elif found := re.fullmatch(rf"sleep\(({NUMBER})\)", line):
            steps.append(("dwell", float(found[1])))
        elif re.fullmatch(
            r'popup\("[^"]*", title="edtk", warning=False, error=False, blocking=True\)', line
        ):
            steps.append(("stop",))
        elif re.fullmatch(r'textmsg\("[^"]*"\)', line):
            asked = re.fullmatch(r"set_standard_digital_out\((\d), True\)", body.pop(0))[1]
            done = _ur_loop(body, "False")
            assert body.pop(0) == f"set_standard_digital_out({asked}, False)"
            assert _ur_loop(body, "True") == done
            steps.append(("ask", asked, done))
        else:
            raise AssertionError(line)
    return name, steps


def _ur_loop(body: list[str], before: str) -> str:
    """The input on which a loop waits."""
    loop = rf"while \(get_standard_digital_in\((\d)\) == {before}\):"
    found = re.fullmatch(loop, body.pop(0))
    assert [body.pop(0), body.pop(0)] == ["sync()", "end"]
    return found[1]


def read_fanuc(files: dict[str, str]) -> tuple[str, Steps]:
    """A listing."""
    text = files[".ls"]
    blocks = re.fullmatch(
        r"/PROG  ([A-Z]\w{0,35})\n/ATTR\n(.+)\n/MN\n(.*)\n/POS\n(.*)\n/END\n", text, re.DOTALL
    )
    name, attributes, steps_text, positions = blocks.groups()
    assert "DEFAULT_GROUP\t= 1,*,*,*,*;" in attributes
    poses = {}
    for block in re.finditer(r'P\[(\d+):"([^"]{0,16})"\]\{\n   GP1:\n(.*?)\n\};', positions, re.S):
        uf, values = block[3].split(",\n", 1)
        assert uf == "\tUF : F, UT : F"
        cells = re.split(r",\s+", values.strip())
        found = [re.fullmatch(rf"([JE]\d)=\s+({NUMBER}) (deg|mm)", cell) for cell in cells]
        poses[int(block[1])] = {one[1]: float(one[2]) for one in found}
    lines = []
    for number, line in enumerate(steps_text.splitlines(), 1):
        found = re.fullmatch(r" *(\d+):(.*) ;", line)
        assert int(found[1]) == number
        lines.append(found[2].strip())
    return name, list(_fanuc_steps(lines, poses))


def _fanuc_steps(lines: list[str], poses: dict[int, dict[str, float]]) -> Iterator[tuple]:
    while lines:
        line = lines.pop(0)
        if line.startswith("!"):
            assert len(line) <= 33
            yield from _rows(line)
        elif found := re.fullmatch(r"J P\[(\d+)\] (\d+)% FINE", line):
            assert 1 <= int(found[2]) <= 100
            yield "move", poses[int(found[1])]
        elif found := re.fullmatch(r"WAIT +(\d+\.\d\d)\(sec\)", line):
            yield "dwell", float(found[1])
        elif line == "PAUSE":
            yield ("stop",)
        elif found := re.fullmatch(r"DO\[(\d+)\]=ON", line):
            rest = [lines.pop(0) for _ in range(3)]
            done = re.fullmatch(r"WAIT DI\[(\d+)\]=ON", rest[0])[1]
            assert rest[1:] == [f"DO[{found[1]}]=OFF", f"WAIT DI[{done}]=OFF"]
            yield "ask", found[1], done
        else:
            assert re.fullmatch(r"MESSAGE\[.{1,24}\]", line), line


def read_table(files: dict[str, str]) -> tuple[str, Steps]:
    """A table of steps, which has no name of its own."""
    steps: Steps = []
    for row in csv.DictReader(files[".csv"].splitlines()):
        joints = [key for key in row if key.endswith(("_deg", "_mm"))]
        if row["step"] in ("pose", "via", "home"):
            if row["first_row"]:
                steps.append(("rows", int(row["first_row"]), int(row["last_row"])))
            steps.append(("move", {key: float(row[key]) for key in joints}))
        elif row["step"] == "dwell":
            steps.append(("dwell", float(row["seconds"])))
        elif row["step"] == "wait":
            asked = row["output"]
            steps.append(("ask", asked, row["input"]) if asked else ("stop",))
        else:
            assert row["step"] == "comment"
    return "", steps


READERS: dict[str, Callable[[dict[str, str]], tuple[str, Steps]]] = {
    "krl": read_krl,
    "rapid": read_rapid,
    "urscript": read_urscript,
    "fanuc_ls": read_fanuc,
    "csv": read_table,
}

"""Does a run survive kill -9 at any moment, and every command a full disk?

    python studies/kills_and_full_disks.py [--kills 25]

Kills: a small study is run, killed at a moment, and started again; at the end every file must have
the bytes of a run that was never killed, and no other file may be there. Moments are spread evenly
over the time of a whole run. Full disks: every command that writes is carried out where no file may
become larger than some bytes (RLIMIT_FSIZE); it must end with code 2 and one line that names a file
that it was asked to write, and leave the folder as it was. The tables are in
kills_and_full_disks.md.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import monotonic, sleep

from edtk.system.files import write_text

HERE = Path(__file__).parent
PLAN = HERE / "plans" / "table_4_3.csv"
SMALL = (
    ("candidates = 2000", "candidates = 300"),
    ("sizes = [2, 3, 4, 6, 12]", "sizes = [3]"),
    ("starts = 32", "starts = 1"),
    ('["rho0", "A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5"]', '["rho0", "E"]'),
    ('["A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0"]', '["E", "rho0"]'),
)
LEFT = (0, 100, 5_000, 20_000)  # bytes that a file may have
COMMANDS = (
    "template STUDY PLAN --out a.csv",
    "plan STUDY --size 3 --workers 1 --out a.csv --certificate b.json",
    "relax STUDY --out a.csv --certificate b.json",
    "identify STUDY SHEET --as-is --out a",
    "compensate STUDY K PLAN --out a.csv",
    "bayes STUDY PLAN --accuracy 0.2 --chain a.h5",
    "bayes STUDY PLAN --accuracy 0.2 --export a.nc --figures b",
    "run STUDY --workers 1 --out a",
)

RECORD = """# Kills and full disks

Written by `python studies/kills_and_full_disks.py`, which says how both are tried.

## Full disks: no file may become larger than some bytes

{disks}
## Kills: `kill -9` at moments of a whole run, started again afterwards

Moments are parts of the time that the first, whole run took; a faster one ends before the last of
them.

{kills}"""


def study_in(folder: Path) -> Path:
    """A small copy of the paper's study, without published plans."""
    text = (HERE / "kr270_milling.toml").read_text(encoding="utf-8")
    text = text[: text.index("published = [")] + text[text.index("[tool]") :]
    for old, new in SMALL:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    write_text(folder / "study.toml", text)
    return folder / "study.toml"


def content(folder: Path) -> dict[str, bytes]:
    """All files below a folder by name, folders as empty ones."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else b""
        for path in folder.rglob("*")
    }


def command(*arguments: object) -> list[str]:
    """The command line of the toolkit of this Python."""
    return [sys.executable, "-m", "edtk", *map(str, arguments)]


def kills(folder: Path, times: int) -> str:
    """Kill runs at so many moments; the table's text."""
    run = ("run", study_in(folder), "--workers", 1, "--out")
    begin = monotonic()
    subprocess.run(command(*run, folder / "whole"), check=True, capture_output=True)
    whole_s = monotonic() - begin
    expected = content(folder / "whole")
    rows = []
    for number in range(times):
        out = folder / f"killed_{number}"
        process = subprocess.Popen(
            command(*run, out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        share = (number + 0.5) / times
        sleep(share * whole_s)
        process.kill()
        killed = process.wait() < 0
        there = len(content(out))
        subprocess.run(command(*run, out), check=True, capture_output=True)
        same = content(out) == expected
        rows.append(f"| {share:.2f} | {'yes' if killed else 'ended before'} | {there} | {same} |\n")
    return "| moment | killed | files then | same bytes in the end |\n|-|-|-|-|\n" + "".join(rows)


def full_disks(folder: Path) -> str:
    """Carry out every command where the disk is full; the table's text."""
    study = study_in(folder)
    sheet = folder / "sheet.csv"
    subprocess.run(command("template", study, PLAN, "--out", sheet), check=True)
    write_text(sheet, sheet.read_text().replace(",,,", ",0.1,0.2,-0.3,").replace(",,", ",0.2,-0.3"))
    write_text(
        folder / "k.json", '{"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6, "q6": 2.1e-6}'
    )
    places = {"STUDY": study, "PLAN": PLAN, "SHEET": sheet, "K": folder / "k.json"}
    rows = []
    for line in COMMANDS:
        for left in LEFT:
            out = folder / "out"
            out.mkdir(exist_ok=True)
            before = content(out)
            done = subprocess.run(
                command(*(places.get(word, word) for word in line.split())),
                capture_output=True,
                text=True,
                cwd=out,
                preexec_fn=lambda left=left: resource.setrlimit(
                    resource.RLIMIT_FSIZE, (left, left)
                ),
            )
            said = [text for text in done.stderr.splitlines() if text.startswith("edtk: ")]
            last = said[-1] if said else ""
            # A run keeps the cases that it has finished: they are the last good state.
            after = {n: b for n, b in content(out).items() if n != "a" and "cases" not in n}
            good = done.returncode == 2 and "File too large" in last and after == before
            clean = good and done.stdout == "" and "Traceback" not in done.stderr
            fits = done.returncode == 0
            subprocess.run(["rm", "-rf", str(out)], check=True)
            verdict = "fits" if fits else "one line" if clean else f"FAULT {done.returncode}"
            rows.append(f"| `{line}` | {left} | {verdict} | {last} |\n")
    return "| command | bytes | result | line |\n|-|-|-|-|\n" + "".join(rows)


def main() -> None:
    """Do both, and write the tables beside this file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=25)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        disks = full_disks(Path(name))
        killed = kills(Path(name), given.kills)
    write_text(HERE / f"{Path(__file__).stem}.md", RECORD.format(disks=disks, kills=killed))


if __name__ == "__main__":
    main()

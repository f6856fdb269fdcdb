"""Values that programs stumble over: numbers, texts and names of files."""

import os
from pathlib import Path
from random import Random
from stat import S_IFCHR

# fmt: off
NUMBERS = (
    "0", "-0", "-0.0", "-1", "1", "2", "0.5", "1e-3", "1e3", "57.29577951", "1e5", "-1e5",
    "1e-300", "5e-324", "1e-160", "1e12", "1.1e12", "1e30", "1e76", "1e77", "1e100", "1e150",
    "1e153", "1e154", "1e155", "1e200", "1e300", "1e308", "-1e308", "1.8e308", "1e309", "-1e400",
    "nan", "-nan", "NaN", "inf", "-inf", "+inf", "Infinity", "-Infinity", "2147483648",
    "-2147483649", "9223372036854775807", "9223372036854775808", "18446744073709551616",
    "9" * 400, "9" * 4300, "9" * 4301, "-" + "9" * 5000, "0." + "0" * 400 + "1",
    "0." + "3" * 5000, "1e" + "9" * 400, "0x10", "0b1", "0o7", "1_000", "1,5", "1.2.3", "1e",
    "1e+", "--1", "+", ".", "1 2", "١٢", "½", "１２", "−5", "5°", "3mm", "true", "false", "True",
    "NULL", "None", "N/A", "#N/A", "", " ", "-", "=1+1", "=cmd|' /C'!A0",
)
TEXTS = (
    "", " ", "-", "--", "--help", "--json", "nan", "inf", "None", "null", "true", "0", "1e308",
    "\n", "a\nb", "\r", "\r\n", "\t", "\x01", "\x07", "\x1b[31mred\x1b[0m", "\x7f", "\x85",
    "\u2028", "\u202eabc", "\ufeff", "é", "ß" * 100, "😀" * 10, "Ω", "e\u0301", "\udcff",
    "a\udc80b", "𝔘", "a" * 300, "b" * 5_000, "c" * 100_000, "x " * 500, "$", "$x^2",
    "$\\frac{1}{0}$", "\\", "_^", "<script>alert(1)</script>", "<b>", "&amp;", "|", "%s%n%d",
    "{0}", "{", "}", "[", "[" * 2_000, "#1", "# comment", "Unnamed: 3", "'", '"', "`id`", "$(id)",
    ";", "a,b", "a;b", "=1+1", "@SUM(1)", "+1", "-1", "../up", "/", ".", "..", "~", "x", "y",
    "z0", "dx", "sigma", "k", "repeats", "Fx", "q1", "q2", "Q2", "q2 ", "joint:q2", "D", "rho0",
    "d", "CON", "NUL", "a/b", "a\\b", "std",
)
PATHS = (
    "", " ", ".", "..", "/", "~", "-", "./", "nowhere.csv", "nowhere/at/all.csv", "plan.csv/",
    "plan.csv/x.csv", "folder", "folder.csv", "folder/", "empty", "loop", "dangling", "to_plan",
    "to_folder", "to_study", "null", "zero", "full", "random", "study.toml", "robot.toml",
    "plan.csv", "sheet.csv", "k.json", "task.csv", "certificate.json", "chain.h5", "run",
    "run/results.csv", "a" * 255, "b" * 300, "c" * 5_000, "d/" * 3_000, "new line\n.csv",
    "tab\t.csv", "bell\x07.csv", "\x1b[31mred.csv", "\udcff.csv", "latin\udce9.csv", "ü.csv",
    "😀.csv", "\u202e.csv", "$x$.csv", "%s.csv", "{0}.csv", "<b>.csv", "'.csv", '".csv', "--json",
    "-.csv", "=1.csv", "a b.csv", "x.csv.gz", "x.zip", "x.xz", "x.bz2", "x.csv.zst", "study.TOML",
    "//plan.csv", "./plan.csv",
)
# fmt: on
# What stands in every folder besides the inputs, so that these names lead somewhere.
FOLDERS = ("folder", "folder.csv")
LINKS = {
    "loop": "loop",
    "dangling": "nowhere/at/all",
    "to_plan": "plan.csv",
    "to_study": "study.toml",
    "to_folder": "folder",
}
# Major and minor number of each device.
DEVICES = {"null": (1, 3), "zero": (1, 5), "full": (1, 7), "random": (1, 9)}
SYSTEM = {"random": "urandom"}  # names of devices that are called otherwise


def number(rng: Random) -> str:
    """A number that is hard to read, to square or to believe; or what is no number at all."""
    if rng.random() < 0.1:
        return f"{rng.choice((-1, 1)) * 10.0 ** rng.uniform(-320, 308):.{rng.randrange(17)}e}"
    return rng.choice(NUMBERS)


def text(rng: Random) -> str:
    """A text that is hard to print, to parse or to look up."""
    if rng.random() < 0.1:
        return "".join(chr(rng.randrange(1, 0x2000)) for _ in range(rng.randrange(1, 40)))
    return rng.choice(TEXTS)


def path(rng: Random) -> str:
    """A path that is missing, of another kind, or has a name that is hard to print."""
    return rng.choice(PATHS)


def furnish(folder: Path) -> None:
    """Put folders, links and devices of these names into a folder.

    A device is a node of its own, where that is allowed (to root): a program that replaces what
    it was to write to then does not replace the system's. Otherwise it is a link, and the system's
    own device is safe from us.
    """
    for name in FOLDERS:
        (folder / name).mkdir()
    (folder / "empty").touch()
    for name, target in LINKS.items():
        (folder / name).symlink_to(target)
    for name, (major, minor) in DEVICES.items():
        if os.geteuid() == 0:
            os.mknod(folder / name, 0o666 | S_IFCHR, os.makedev(major, minor))
        else:
            (folder / name).symlink_to(f"/dev/{SYSTEM.get(name, name)}")

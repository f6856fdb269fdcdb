"""Finished cases on disk: what counts as finished, and what an answer rests on."""

import importlib.metadata
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from edtk.study.checkpoint import Checkpoint, checkpoint_of
from edtk.study.study import load_study

ROOT = Path(__file__).parents[2]
PATH = ROOT / "studies" / "kr270_milling.toml"
ARM = """
name = "arm"
source = "made up"
[[joints]]
name = "q1"
origin_m = [0, 0, 1.0]
axis = [0, 1, 0]
limits_deg = [-150, 150]
[[joints]]
name = "q2"
origin_m = [0.7, 0, 0]
axis = [0, 1, 0]
limits_deg = [-120, 120]
"""
STUDY = """
title = "Arm"
robot = "arm.toml"
sizes = [2]
optimise = ["D"]
criteria = ["D"]
[tool]
position_mm = [500, 0, 0]
[load]
F_N = [0, 0, -100]
[measurement]
sigma_mm = 0.1
[joints]
unknown = ["q1", "q2"]
[workspace]
excluded = "excluded.csv"
"""
EXCLUDED = "q1_deg,q2_deg\n10,20\n"


@pytest.fixture
def checkpoint(tmp_path):
    return Checkpoint(tmp_path / "cases", "a" * 16)


def test_numbers_come_back_bit_by_bit(checkpoint):
    """Floats, integers, texts and None come back as they were kept; the folder is made."""
    answer = {
        "q": [[0.1 + 0.2, -1e-300, 1e308], [math.pi, 5e-324, -0.0]],
        "starts": 64,
        "ended": "ß",
        "searched": None,
    }
    checkpoint.keep("some_m3", answer)
    found = checkpoint.find("some_m3")
    assert repr(found) == repr(answer)
    assert [path.name for path in checkpoint.folder.iterdir()] == ["some_m3.json"]


def test_a_bound_that_says_nothing_comes_back(checkpoint):
    """An infinite number survives too."""
    checkpoint.keep("some", {"searched": math.inf})
    assert checkpoint.find("some") == {"searched": math.inf}


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff\xfe\x00 no text",
        b'{"key": "aaaaaaaaaaaaaaaa", "answer": {"q": [1',
        b"[1, 2]",
        b"null",
        b'{"answer": {"q": 1}}',
        b'{"key": "bbbbbbbbbbbbbbbb", "answer": {"q": 1}}',
        b'{"key": "aaaaaaaaaaaaaaaa", "answer": [1]}',
        b'{"key": "aaaaaaaaaaaaaaaa"}',
        b'{"key": "aaaaaaaaaaaaaaaa", "answer": {"q": 1}}',
        b'{"key": "aaaaaaaaaaaaaaaa", "seal": "0123456789abcdef", "answer": {"q": 1}}',
        b'{"key": "aaaaaaaaaaaaaaaa", "answer": {"q": 1' + 5000 * b"0" + b"}}",
        b"[" * 100_000,
    ],
)
def test_what_is_no_answer_is_not_there(checkpoint, content):
    """Garbage, half a file, another key and a missing answer count as nothing, and are replaced."""
    checkpoint.folder.mkdir()
    (checkpoint.folder / "some.json").write_bytes(content)
    assert checkpoint.find("some") is None
    checkpoint.keep("some", {"q": 1})
    assert checkpoint.find("some") == {"q": 1}


def test_nothing_is_there_before_it_is_kept(checkpoint):
    """A missing folder, file or case is None; neither asking nor forgetting makes anything."""
    assert checkpoint.find("some") is None
    checkpoint.forget_others(["some"])
    assert not checkpoint.folder.exists()
    checkpoint.keep("some", {})
    assert checkpoint.find("other") is None
    (checkpoint.folder / "folder.json").mkdir()
    assert checkpoint.find("folder") is None


def test_what_was_removed_meanwhile_is_written_again(checkpoint):
    """A folder that somebody removes while a run goes on has every finished case at its end."""
    answer = {"value": 1.5}
    checkpoint.keep("relaxation_D", answer)
    path = checkpoint.folder / "relaxation_D.json"
    written = path.read_bytes()
    path.unlink()
    checkpoint.folder.rmdir()
    checkpoint.restore()
    assert path.read_bytes() == written


def test_forget_others_leaves_named_cases_and_other_files(checkpoint):
    """Of the JSON files those that are named stay; other files do anyway."""
    for name in ("one", "two", "three"):
        checkpoint.keep(name, {"name": name})
    (checkpoint.folder / "notes.txt").write_text("mine")
    checkpoint.forget_others(["two", "four"])
    assert {path.name for path in checkpoint.folder.iterdir()} == {"two.json", "notes.txt"}
    assert checkpoint.find("two") == {"name": "two"}


@pytest.fixture
def folder(tmp_path):
    """A folder with a study, its own robot and poses to stay away from."""
    for name, content in {"study.toml": STUDY, "arm.toml": ARM, "excluded.csv": EXCLUDED}.items():
        (tmp_path / name).write_text(content)
    return tmp_path


def key(folder, excluded=None):
    return checkpoint_of(load_study(folder / "study.toml", excluded), folder / "cases").key


def test_key_does_not_depend_on_the_place(folder, tmp_path_factory):
    """The same files in another folder have the same key: sixteen hex digits."""
    other = tmp_path_factory.mktemp("other")
    shutil.copytree(folder, other, dirs_exist_ok=True)
    assert key(folder) == key(other)
    assert len(bytes.fromhex(key(folder))) == 8


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("study.toml", "[0, 0, -100]", "[0, 0, -101]"),
        ("study.toml", "sizes = [2]", "sizes = [2]\nseed = 1"),
        ("arm.toml", "origin_m = [0.7, 0, 0]", "origin_m = [0.8, 0, 0]"),
        (
            "arm.toml",
            "axis = [0, 1, 0]\nlimits_deg = [-120",
            "axis = [0, 0, 1]\nlimits_deg = [-120",
        ),
        ("arm.toml", "[-120, 120]", "[-120, 121]"),
        ("excluded.csv", "10,20", "10,21"),
        ("excluded.csv", "10,20\n", "10,20\n-10,20\n"),
    ],
)
def test_key_depends_on_the_study_its_robot_and_its_exclusions(folder, name, old, new):
    """A changed file gives another key, and the same file again the same key."""
    before = key(folder)
    text = (folder / name).read_text()
    assert text.count(old) == 1
    (folder / name).write_text(text.replace(old, new))
    assert key(folder) != before
    (folder / name).write_text(text)
    assert key(folder) == before


def test_key_depends_on_poses_excluded_besides(folder, tmp_path):
    """Poses that are excluded by option count as those in the study do."""
    more = tmp_path / "more.csv"
    more.write_text("q1_deg,q2_deg\n50,60\n")
    assert key(folder, more) != key(folder)


@pytest.mark.parametrize("library", ["numpy", "scipy", "cvxpy", "clarabel", "scs"])
def test_key_depends_on_the_numerical_libraries(folder, monkeypatch, library):
    """Another version of a library that computes the answers is another key."""
    before = key(folder)
    true = importlib.metadata.version
    monkeypatch.setattr(
        importlib.metadata, "version", lambda name: "0.0.1" if name == library else true(name)
    )
    assert key(folder) != before


@pytest.mark.slow
def test_key_depends_on_the_code(tmp_path):
    """A changed line in the toolkit, or in a criterion, is another key."""
    for package in ("edtk", "criteria"):
        shutil.copytree(
            ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    script = (
        "import sys\nfrom pathlib import Path\n"
        "from edtk.study.checkpoint import checkpoint_of\n"
        "from edtk.study.study import load_study\n"
        "study = load_study(sys.argv[1])\nkeys = []\n"
        "for path in (None, *map(Path, sys.argv[2:])):\n"
        "    if path:\n        path.write_text(path.read_text() + '# more\\n')\n"
        "    keys.append(checkpoint_of(study, Path('cases')).key)\n"
        "import edtk\nprint(edtk.__file__, *keys)"
    )
    changed = [tmp_path / "edtk/design/information.py", tmp_path / "criteria/linalg/inverse.py"]
    env = {**os.environ, "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-W", "error", "-c", script, str(PATH), *map(str, changed)]
    done = subprocess.run(command, capture_output=True, text=True, env=env, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    where, *keys = done.stdout.split()
    assert Path(where).is_relative_to(tmp_path)
    assert len(set(keys)) == 3


def test_file_is_readable(checkpoint):
    """A case file is JSON with its key and its answer."""
    checkpoint.keep("some", {"q": [1.5]})
    content = json.loads((checkpoint.folder / "some.json").read_text())
    assert list(content) == ["key", "seal", "answer"]
    assert content["key"] == "a" * 16
    assert content["answer"] == {"q": [1.5]}


@pytest.mark.parametrize(("old", "new"), [("1.5", "1.6"), ("1.5", '"1.5"'), ('"q"', '"p"')])
def test_a_changed_answer_is_not_there(checkpoint, old, new):
    """Another number, another type or a missing entry: the case is computed anew."""
    checkpoint.keep("some", {"q": [1.5], "r": [2.5]})
    path = checkpoint.folder / "some.json"
    path.write_text(path.read_text().replace(old, new))
    assert checkpoint.find("some") is None
    path.write_text(path.read_text().replace(new, old).replace("\n", " "))
    assert checkpoint.find("some") == {"q": [1.5], "r": [2.5]}

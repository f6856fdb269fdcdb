"""The package as it is shipped: wheel, lock and files."""

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]


def tracked_files() -> list[Path]:
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if listing.returncode:
        pytest.skip("not a git checkout: there is no list of the project's files")
    return [ROOT / name for name in listing.stdout.split("\n") if name and (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--quiet",
    ]
    subprocess.run([*command, "--wheel-dir", folder, ROOT], check=True)
    return next(folder.glob("edtk-*.whl"))


def test_wheel_holds_edtk_and_criteria_and_nothing_else(wheel: Path) -> None:
    """The wheel occupies two import names, and brings the robots and the type marker."""
    names = zipfile.ZipFile(wheel).namelist()
    assert {n.split("/")[0] for n in names if ".dist-info" not in n} == {"edtk", "criteria"}
    needed = {"edtk/robots/builtin/kuka_kr270.toml", "edtk/py.typed", "criteria/py.typed"}
    needed |= {f"edtk/report/show/page.{kind}" for kind in ("html", "css", "js")}
    assert needed <= set(names)


def test_wheel_works_from_another_folder(wheel: Path, tmp_path: Path) -> None:
    """Unpacked elsewhere, both packages import from there and know their criteria and robots."""
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r}); import criteria, edtk; "
        "assert criteria.__file__.startswith(sys.path[0]); "
        "assert edtk.__file__.startswith(sys.path[0]); "
        "print(len(criteria.available()), edtk.load_robot('kuka_kr270').n)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert answer.stdout.split() == ["11", "6"]


def test_no_file_names_a_registry_or_a_machine_path() -> None:
    """No registry host, no address of a package file, and no path of a machine is in any file."""
    hosts = (
        "py" + "pi.org",
        "python" + "hosted.org",
        "registry." + "npmjs.org",
        "deb." + "debian.org",
    )
    paths = re.compile(
        r"(?<![\w.])/(?:home|root|work|Users|opt)/\w|https?://\S+\.(?:whl|tar\.gz|zip)\b"
    )
    for path in tracked_files():
        if path.suffix in {".png", ".svg"}:
            continue
        text = path.read_text(encoding="utf-8")
        assert not [h for h in hosts if h in text], path
        assert not paths.search(text), (path, paths.search(text))


def test_every_requirement_of_the_lock_is_pinned_with_hashes() -> None:
    """Each entry of the lock is one exact version with at least one hash, and the lock has no
    address.
    """
    text = (ROOT / "requirements.lock").read_text()
    entries = [e for e in re.split(r"\n(?=[a-z])", text) if re.match(r"[a-z]", e)]
    assert len(entries) > 30
    assert "://" not in text
    for entry in entries:
        assert re.match(r"[a-z0-9._-]+==[\w.]+", entry)
        assert "--hash=sha256:" in entry

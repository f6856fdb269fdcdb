"""One version, wherever it is asked for."""

import tomllib
from pathlib import Path

import edtk
from edtk.version import __version__


def test_the_package_and_its_metadata_agree() -> None:
    """The version of the module, of the front door and of the built wheel are the same."""
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    assert edtk.__version__ == __version__ == project["version"]

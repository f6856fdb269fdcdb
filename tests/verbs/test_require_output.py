"""Outputs are checked before the work."""

import os

import pytest

from edtk.system.errors import ArgumentError, UserError
from edtk.verbs.inputs import require_different, require_file, require_folder, require_output

SHEET = "q2_deg,dx_mm,dy_mm,dz_mm\n0,{},,\n"


@pytest.mark.unix
def test_an_input_is_no_output_through_links_either(tmp_path):
    """A link to a file that is read is that file."""
    (tmp_path / "study.toml").write_text("title = 'mine'")
    (tmp_path / "link").symlink_to("study.toml")
    for path in ("study.toml", "link", "./study.toml"):
        with pytest.raises(UserError, match="is read by this command"):
            require_output(tmp_path / path, tmp_path / "study.toml")
    loop = tmp_path / "loop"
    loop.symlink_to("loop")
    with pytest.raises(OSError, match="loop"):
        require_output(loop, tmp_path / "study.toml")


@pytest.mark.unix
def test_measurements_are_kept(tmp_path):
    """A filled-in sheet is refused through a link too; an empty one, and a stream, are fine."""
    sheet = tmp_path / "sheet.csv"
    (tmp_path / "link").symlink_to("sheet.csv")
    for content, refused in (("0.1", True), ("", False)):
        sheet.write_text(SHEET.format(content))
        for path in (sheet, tmp_path / "link"):
            if refused:
                with pytest.raises(UserError, match="has measurements in it"):
                    require_output(path)
            else:
                require_output(path)
    os.mkfifo(tmp_path / "pipe")
    for path in ("-", "/dev/null", "/dev/full", tmp_path / "pipe", None):
        require_output(path)


@pytest.mark.unix
def test_two_outputs_are_two_places(tmp_path):
    """Two names of one file, or of standard output, would leave one of two contents."""
    (tmp_path / "link").symlink_to("plan.csv")
    plan = tmp_path / "plan.csv"
    for out, certificate in ((plan, plan), (plan, tmp_path / "link"), ("-", "-")):
        with pytest.raises(ArgumentError, match=r"certificate .*another output") as caught:
            require_different(out=out, certificate=certificate)
        assert caught.value.argument == "certificate"
    require_different(out=plan, certificate=None)
    require_different(out=plan, certificate="-")


def test_not_everything_can_be_printed():
    """A chain is read again, and a folder holds several files."""
    with pytest.raises(UserError, match="-: is standard output; expected a file"):
        require_file("-")
    with pytest.raises(UserError, match="-: is standard output; expected a folder"):
        require_folder("-")


def test_a_folder_is_not_named_like_a_file(tmp_path):
    """`--out k.json` asks for a file where a folder is written; one that is there is taken."""
    with pytest.raises(UserError, match=r"k\.json: is named like a file; expected a folder"):
        require_folder("k.json")
    there = tmp_path / "day.csv"
    there.mkdir()
    require_folder(there)
    require_folder("results/2.0")

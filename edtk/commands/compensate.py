"""`edtk compensate`: commands that make up for the deflection under the task's load."""

import json
from pathlib import Path

import click

from edtk.commands.shared import FilePath, require_output


@click.command("compensate")
@click.argument("study", type=FilePath)
@click.argument("k", type=FilePath, metavar="K.json")
@click.argument("task", type=FilePath)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
@click.option("--out", type=FilePath, help="Write commands and errors (CSV).")
def command(study: Path, k: Path, task: Path, as_json: bool, out: Path | None) -> None:
    """Joint angles to command so that the loaded robot is where TASK (CSV) wants it.

    K.json holds the compliances, as an identification writes them; tool, and load where TASK has no wrench columns, are
    those of the test pose of STUDY (TOML).
    """
    from edtk.calibration.compensate import compensate
    from edtk.calibration.load_task import load_task
    from edtk.study.study import load_study
    from edtk.tables.compliances import load_compliances

    loaded = load_study(study)
    require_output(out, *loaded.reads, k, task)
    poses = load_task(loaded, task)
    given = load_compliances(k, loaded.robot.joint_names, loaded.specification.joints.unknown)
    found = compensate(loaded, given, poses, task)
    if out is not None:
        found.to_csv(out)
    if given.verdict == "bad":
        click.echo(
            f"edtk: {k}: the calibration says not to use these compliances; its error band is not to be trusted",
            err=True,
        )
    click.echo(json.dumps(found.to_dict(), indent=2) if as_json else found.summary())

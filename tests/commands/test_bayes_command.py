"""`edtk bayes`: its options, and what it leaves behind."""

import json
import signal
import sys
import time
import warnings
from pathlib import Path

import emcee
import pytest
from arm import arm
from click.testing import CliRunner
from forked_command import ForkedCommand

from edtk.cli import main

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
STUDY = ROOT / "studies" / "kr270_milling.toml"
PLAN = ROOT / "studies" / "plans" / "table_4_12.csv"
LONGEST_WAIT = 600  # seconds for a first block of steps


def edtk(*arguments):
    return CliRunner().invoke(main, ["bayes", *map(str, arguments)])


def write(folder, prior):
    """The example with a [prior] table, without its published plans."""
    head, rest = STUDY.read_text(encoding="utf-8").split("published = [")
    path = folder / "study.toml"
    path.write_text(f"{head}{rest.split(']', 1)[1]}\n{prior}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("prior", "words"),
    [
        ('prior.all = { kind = "cauchy" }', ("prior.all.kind", "half-normal")),
        ('prior.all = { kind = "half-normal" }', ("prior.all", "scale_rad_per_Nm")),
        (
            'prior.all = { kind = "log-normal", median_rad_per_Nm = 1e-6 }',
            ("prior.all", "median", "factor"),
        ),
        (
            'prior.all = { kind = "log-normal", median_rad_per_Nm = 1e-6, factor = 1 }',
            ("prior.all.factor", "than 1"),
        ),
        ('prior.joints.q1 = { kind = "flat" }', ("prior.joints", "'q1'", "q2, q3, q4, q5, q6")),
        ("prior.sigma_factor = 0.5", ("prior.sigma_factor", "from 1 to 1e6")),
        ("prior.nu = -1", ("prior.nu", "from 0.1 to 1e6")),
        ("prior.nu = [1]", ("prior.nu", "from 0.1 to 1e6")),
        (
            "prior.earlier = { mean_rad_per_Nm = { q2 = 1 }, covariance = [[1]] }",
            ("prior.earlier.mean", "q2, q3"),
        ),
    ],
)
def test_bad_prior(tmp_path, prior, words):
    """Each mistake in the [prior] table is one line that names the file and the key."""
    text = write(tmp_path, "").read_text()
    path = tmp_path / "study.toml"
    path.write_text(f"{prior}\n{text}")
    answer = edtk(path, PLAN)
    assert answer.exit_code == 2
    message = answer.stderr.split("\n")[-2]
    assert all(word in message for word in ("study.toml", *words)), message


@pytest.mark.parametrize("covariance", ["[[1]]", "[[1, 0, 0, 0, 0]]", str([[1] * 5] * 5)])
def test_bad_covariance(tmp_path, covariance):
    """A covariance of the wrong size, or none at all, is one line."""
    means = ", ".join(f"q{i} = 1e-6" for i in range(2, 7))
    path = write(
        tmp_path, f"[prior.earlier]\nmean_rad_per_Nm = {{ {means} }}\ncovariance = {covariance}"
    )
    answer = edtk(path, PLAN)
    assert answer.exit_code == 2
    assert "prior.earlier.covariance: expected" in answer.stderr


def test_prior_of_the_study_counts(tmp_path):
    """A narrow prior of one joint makes its posterior as narrow."""
    prior = (
        '[prior.joints]\nq6 = { kind = "log-normal", median_rad_per_Nm = 2.1e-6, factor = 1.001 }'
    )
    answer = edtk(write(tmp_path, prior), PLAN, "--json", "--accuracy", 0.05)
    assert answer.exit_code == 0, answer.stderr
    rows = json.loads(answer.stdout)["parameters"]
    assert rows[4]["std_posterior"] == pytest.approx(2.1e-9, rel=0.15)


def small_study(folder):
    """A study of two compliances with a test pose, and a plan of four experiments."""
    folder.mkdir()
    load = {"F_N": [0, 0, -50]}
    pose = {"q_deg": [9, 40], "tool": {"position_mm": [400, 0, 0]}, "load": load}
    known = {"compliance_rad_per_Nm": {"q1": 1e-5, "q2": 2e-5}}
    arm(test_pose=pose, simulation=known).to_toml(folder / "study.toml")
    plan = folder / "plan.csv"
    plan.write_text("q1_deg,q2_deg\n0,30\n10,60\n-40,-50\n70,20\n")
    return folder / "study.toml", plan


def test_files(tmp_path):
    """Chain, export and pictures are written whole; ArviZ reads the export with its names and
    shapes.
    """
    chain = tmp_path / "a.h5"
    nc = tmp_path / "a.nc"
    figures = tmp_path / "figures"
    options = ["--sigma-factor", "inf", "--nu", "sampled", "--accuracy", 0.3]
    study, plan = small_study(tmp_path / "study")
    answer = edtk(study, plan, "--chain", chain, "--export", nc, "--figures", figures, *options)
    assert answer.exit_code == 0, answer.stderr
    assert {p.name for p in figures.iterdir()} == {"corner.png", "trace.png", "residuals.png"}
    assert {p.name for p in tmp_path.iterdir()} == {"a.h5", "a.nc", "figures", "study"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import arviz

        data = arviz.from_netcdf(str(nc))
    assert set(data.posterior) == {"k1", "k2", "sigma_ratio", "nu", "displacement"}
    assert data.posterior["k2"].shape[0] == 32
    assert data.observed_data["deflection"].shape == (4, 3)
    assert (data.posterior["k2"].units, data.posterior["displacement"].units) == ("rad/(N m)", "m")
    assert data.posterior["displacement"].shape[2:] == (3,)


@pytest.mark.unix
def test_killed_run_goes_on(tmp_path):
    """A run that is killed leaves a whole chain, and another goes on from it."""
    path = tmp_path / "chain.h5"
    with ForkedCommand("bayes", STUDY, PLAN, "--chain", path, "--accuracy", 0.001) as process:
        # A loaded machine may take minutes: what tells a fault is a run that ends.
        deadline = time.monotonic() + LONGEST_WAIT
        while not path.exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
        said = process.communicate()[1].decode()
    assert path.exists(), f"no chain from a run that ended with {process.returncode}: {said}"
    before = emcee.backends.HDFBackend(path, read_only=True).get_chain()
    edtk(STUDY, PLAN, "--chain", path, "--accuracy", 0.001, "--most", len(before) + 500)
    after = emcee.backends.HDFBackend(path, read_only=True).get_chain()
    assert len(after) == len(before) + 500 > 500
    assert (after[: len(before)] == before).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--most", 600, "--accuracy", 0.001], ("did not converge in 600 steps",)),
        (["--nu", "many"], ("--nu", "above zero or 'normal' or 'sampled'")),
        (["--sigma-factor", "0.5"], ("--sigma-factor", "at least 1")),
        (["--chain", ROOT / "README.md"], ("README.md: not a chain",)),
        (["--chain", STUDY], ("kr270_milling.toml: is read by this command",)),
        (["--export", STUDY / "x.nc"], ("cannot be written there",)),
    ],
)
def test_mistakes(options, words):
    """Mistakes are one line each, and leave the files named as they were."""
    before = STUDY.read_bytes()
    answer = edtk(STUDY, PLAN, *options)
    assert answer.exit_code == 2
    assert answer.stdout == ""
    assert all(word in answer.stderr.split("\n")[-2] for word in words), answer.stderr
    assert STUDY.read_bytes() == before


@pytest.mark.parametrize(("option", "module"), [("--chain", "h5py"), ("--export", "arviz")])
def test_missing_extra(tmp_path, monkeypatch, option, module):
    """Without the extra one line says how to have it."""
    monkeypatch.setitem(sys.modules, module, None)
    answer = edtk(STUDY, PLAN, option, tmp_path / "file")
    assert answer.exit_code == 2
    assert "edtk[posterior], which is not installed" in answer.stderr

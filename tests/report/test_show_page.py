"""The page of poses in a real browser, without a network: what it draws, obeys and asks for."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from gantry import ROBOT as GANTRY
from gantry import STUDY as GANTRY_STUDY
from kr270 import REQUIRED, TEST_POSE

import edtk
from edtk.report.show.page import page_data, page_html
from edtk.report.show.plate import plate, plate_words
from edtk.report.show.stage import Stage
from edtk.study.study import Study

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium here"),
]
SIMULATED = {"compliance_rad_per_Nm": {"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6}}
TRACKER = {"tracker_position_mm": [4000, 1000, 800], "along": [10, 5], "across": [15, 6]}
NEAR = 1e-6  # [m]


def plan_for(study: Study, poses: int, wrench: tuple[float, ...]) -> edtk.Plan:
    """Random poses within the limits, each under one load."""
    lower, upper = study.robot.limits
    q = np.random.default_rng(3).uniform(0.8 * lower, 0.8 * upper, (poses, study.robot.n))
    return edtk.Plan(q, np.tile(wrench, (poses, 1)), np.arange(poses) % 3 + 1)


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Stage]:
    """Pages of a KR 270, of an arm that slides, and of a palletiser, whose joints are coupled."""
    folder = tmp_path_factory.mktemp("pages")
    (folder / "gantry.toml").write_text(GANTRY)
    (folder / "study.toml").write_text(GANTRY_STUDY)
    heavy = Study(
        **REQUIRED | {"test_pose": TEST_POSE, "simulation": SIMULATED, "noise": TRACKER},
        title="KR 270 <script>alert(1)</script> & friends",
    )
    studies = {
        "kr270": (heavy, (0, 0, -2500, 0, 0, 0)),
        "gantry": (edtk.load_study(folder / "study.toml"), (0, 0, -300, 0, 0, 0)),
        "palletiser": (edtk.load_study(STUDIES / "palletiser.toml"), (0, 300, -900, 0, 0, 0)),
    }
    made = {}
    for name, (study, wrench) in studies.items():
        made[name] = edtk.show(study, plan_for(study, 9, wrench), out=folder / f"{name}.html").stage
    made["folder"] = folder
    return made


STUDIES = Path(__file__).parents[2] / "studies"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One browser for all tests, as it takes half a second to start."""
    with Browser(tmp_path_factory.mktemp("chromium")) as found:
        yield found


@pytest.mark.parametrize("name", ["kr270", "gantry", "palletiser"])
def test_links_are_where_the_kinematics_have_them(
    name: str, stages: dict, browser: Browser
) -> None:
    """Frames of all joints and of the tool, in every pose, to a millionth of a metre."""
    stage = stages[name]
    browser.open(stages["folder"] / f"{name}.html")
    for i in range(len(stage.q)):
        found = json.loads(browser.run(f"JSON.stringify(edtkShow.place({i}))"))
        frames = stage.robot.frames(stage.q[i], bodies=range(len(stage.robot.chain)))
        for j, body in enumerate(found["bodies"]):
            T = np.reshape(body, (3, 4))
            rotation, origin = frames.bodies[j]
            assert T[:, 3] == pytest.approx(origin, abs=NEAR)
            assert T[:, :3] == pytest.approx(rotation.T, abs=NEAR)
        assert np.array(found["origins"]) == pytest.approx(frames.origins, abs=NEAR)
        assert np.array(found["tip"])[3::4] == pytest.approx(frames.position, abs=NEAR)


def test_a_bent_arm_moves_by_a_hundred_times_its_deflection(stages: dict, browser: Browser) -> None:
    """The tool point of the picture is off by 100 times what the model says of it."""
    stage = stages["kr270"]
    browser.open(stages["folder"] / "kr270.html")
    straight, bent = (
        np.array(browser.run(f"edtkShow.{which}(4).tip"))[3::4] for which in ("place", "bent")
    )
    study = Study(**REQUIRED)
    k = np.array([*SIMULATED["compliance_rad_per_Nm"].values(), 0.0])
    moved = study.model.deflection(stage.q[4], stage.wrench[4], k)
    assert bent - straight == pytest.approx(100 * moved, abs=1e-5)


def test_it_asks_for_nothing_and_complains_of_nothing(stages: dict, browser: Browser) -> None:
    """In both widths and both schemes the page is the only request, and no script errs."""
    path = stages["folder"] / "kr270.html"
    for width in (1280, 390):
        for dark in (False, True):
            browser.requests.clear()
            browser.complaints.clear()
            browser.open(path, width, dark=dark)
            assert browser.requests == [path.absolute().as_uri()]
            assert browser.complaints == []
            assert browser.run("document.documentElement.scrollWidth") <= width
            sees = browser.run("document.getElementById('view').getBoundingClientRect().width")
            assert sees > 0.6 * min(width, 900)
            small = (
                "Math.min(...[...document.querySelectorAll('body *')].filter(e => e.offsetWidth)"
                ".map(e => parseFloat(getComputedStyle(e).fontSize)))"
            )
            assert browser.run(small) >= 12
            page = browser.run("getComputedStyle(document.body).backgroundColor")
            assert (page == "rgb(23, 25, 28)") is dark
    assert "alert(1)" in browser.run("document.title")  # a title is text, whatever it says


DRAWN = """(() => {
  const view = document.getElementById('view'), copy = document.createElement('canvas');
  [copy.width, copy.height] = [view.width, view.height];
  const pen = copy.getContext('2d');
  pen.drawImage(view, 0, 0);
  const pixels = pen.getImageData(0, 0, copy.width, copy.height).data;
  let sum = 0, seen = 0;
  for (let i = 3; i < pixels.length; i += 4) {
    if (pixels[i] < 250) continue;
    seen += 1;
    sum = (31 * sum + pixels[i - 1] + 3 * pixels[i - 2] + 7 * pixels[i - 3] + i) % 1000000007;
  }
  return [seen / (pixels.length / 4), sum];
})()"""


def test_keys_slider_and_mouse_change_the_picture(stages: dict, browser: Browser) -> None:
    """Each of them leads to another picture, and words, slider and table say the same pose."""
    browser.open(stages["folder"] / "kr270.html")

    def drawn() -> tuple[float, int]:
        browser.settle()
        share, mark = browser.run(DRAWN)
        assert share > 0.005  # there is an arm
        return mark

    def pose() -> tuple[int, int, str]:
        row = "[...document.querySelectorAll('#table tbody tr')].findIndex(r => r.ariaCurrent"
        return (
            browser.run("Number(document.getElementById('pose').value)"),
            browser.run(f"{row} === 'true') + 1"),
            browser.run("document.getElementById('name').textContent"),
        )

    seen = [drawn()]
    for key, at in (("ArrowRight", 2), ("End", 9), ("ArrowLeft", 8), ("Home", 1)):
        browser.press(key)
        assert pose() == (at, at, f"pose {at}")
        seen.append(drawn())
    assert len(set(seen)) == 4  # the first pose was there twice
    assert seen[0] == seen[-1]
    for key in "gdbnc2345+":
        browser.press(key)
        seen.append(drawn())
    browser.press("ArrowUp", shift=True)
    seen.append(drawn())
    browser.drag((300, 300), (380, 340))
    seen.append(drawn())
    browser.run(
        "(s => { s.value = 5; s.dispatchEvent(new Event('input')); })"
        "(document.getElementById('pose'))"
    )
    seen.append(drawn())
    assert pose()[0] == 5
    # Names alone are no part of the canvas; the plain colour comes after the only shade.
    repeated = len(seen) - len(set(seen))
    assert repeated <= 2
    browser.run("document.querySelectorAll('#table tbody button')[2].click()")
    assert pose() == (3, 3, "pose 3")
    assert "q2" in browser.run("document.getElementById('view').ariaLabel")


def test_play_goes_from_pose_to_pose_with_all_joints_in_step(
    stages: dict, browser: Browser
) -> None:
    """Between two poses each joint has gone the same share of its way."""
    browser.open(stages["folder"] / "gantry.html")
    browser.press("p")
    moving = "new Promise(f => { const look = () => edtkShow.state.at % 1 > 0.05 ? f(true) : "
    assert browser.run(f"{moving} setTimeout(look, 5); look(); }})")
    browser.press("p")
    assert browser.run("edtkShow.state.at % 1") == 0
    assert browser.run("edtkShow.state.playing") is False


def test_controls_have_names_and_the_table_is_there_without_a_script(stages: dict) -> None:
    """Every control is named, the picture has words, and poses stand in plain HTML."""
    text = (stages["folder"] / "kr270.html").read_text()
    assert text.count("<tr>") == 1 + len(stages["kr270"].q)
    assert text.index("Content-Security-Policy") < text.index("<style>")
    assert "<script>alert" not in text
    assert "eval(" not in text
    for label in ("Pose before", "Next pose", "Pose, in the order of measuring"):
        assert f'aria-label="{label}"' in text
    assert len(text) < 100_000


def test_rods_lead_on_where_a_link_has_no_body(tmp_path: Path) -> None:
    """An arm whose URDF gives bodies to some links alone does not fall in two."""
    box = '<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision>'
    links = "".join(f'<link name="l{i}">{box if i in (0, 1, 3) else ""}</link>' for i in range(4))
    joints = "".join(
        f'<joint name="q{i + 1}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<origin xyz="0 0 0.4"/><axis xyz="0 1 0"/><limit lower="-2" upper="2"/></joint>'
        for i in range(3)
    )
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>')
    study = Study(
        robot=str(tmp_path / "arm.urdf"),
        tool={"position_mm": [200, 0, 0]},
        load={"F_N": [0, 0, -9]},
        measurement={"sigma_mm": 0.1},
        joints={"unknown": ["q1", "q2", "q3"]},
        scene={},
    )
    stage = edtk.show(study, plan_for(study, 1, (0, 0, -9, 0, 0, 0))).stage
    rods = {part.name: part.carrier for part in stage.parts if part.kind == "joint"}
    assert rods == {"link 2": 1}
    assert "links without a body are thin rods from joint to joint" in page_html(stage)


def test_thousands_of_poses_stay_small(stages: dict) -> None:
    """A page has 2,000 poses at most, says of how many, and is below 5 MB."""
    study = Study(**REQUIRED)
    page = edtk.show(study, plan_for(study, 2500, (0, 0, -2500, 0, 0, 0)))
    assert "2000 poses, of 2500" in page.html
    assert len(page.html.encode()) < 5e6
    assert len(page_data(page.stage)["q"]) == 2000


def test_a_plate_has_a_picture_of_each_pose(stages: dict) -> None:
    """Names and numbers of all poses; of many, the first ones, and the caption says so."""
    stage = stages["palletiser"]
    figure = plate(stage)
    (ax,) = figure.axes
    assert [text.get_text().partition(":")[0] for text in ax.texts] == list(stage.names)
    assert plate_words(stage).startswith("The 9 poses, in the order of measuring")
    (drawn,) = ax.collections
    assert len(drawn.get_segments()) >= 2 * 9 * len(stage.robot.chain)
    ends = np.concatenate(drawn.get_segments())
    assert ends[:, 0].min() >= 0
    assert ends[:, 1].max() <= 0
    many = replace(stage, names=stage.names * 4, q=np.tile(stage.q, (4, 1)))
    assert plate_words(many).startswith("The first 24 of 36 poses")

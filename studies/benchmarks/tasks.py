"""How long the relaxation takes for two hundred tasks: rho_max beside rho0, over 10^5 candidates.

Run: python studies/benchmarks/tasks.py. It prints the table of tasks.md.
"""

import time
from pathlib import Path

import numpy as np

import edtk

STUDY = Path(__file__).parents[1] / "kr270_milling.toml"
CANDIDATES = 100_000
TASKS = 200
TURN = np.array([25.0, 12.0, 15.0, 20.0, 15.0, 0.0])  # to either side of the test pose [deg]
PERIODS = np.array([1, 1, 2, 1, 3, 1])
FORCE = 300.0  # [N]


def around(study: edtk.Study, count: int) -> edtk.Study:
    """The study with poses on a closed curve about its test pose, under a load that turns."""
    pose = study.to_dict()["test_pose"]
    angle = 2 * np.pi * np.arange(count) / count
    turned = np.array(pose["q_deg"]) + TURN * np.sin(PERIODS * angle[:, None] + PERIODS)
    force = FORCE * np.stack([np.cos(angle), np.sin(angle), np.full(count, -0.5)], axis=1)
    poses = [
        pose | {"q_deg": q.tolist(), "load": {"F_N": F.tolist()}}
        for q, F in zip(turned, force, strict=True)
    ]
    return study.replace(test_pose=poses, published=None)


def row(study: edtk.Study, name: str) -> str:
    """One line of the table: the second of two relaxations, whose program is compiled."""
    for _ in range(2):
        start = time.perf_counter()
        busy = time.process_time()
        found = edtk.relax(study, name, CANDIDATES)
        wall = time.perf_counter() - start
        busy = time.process_time() - busy
    return (
        f"| {name} | {len(study.tasks)} | {1e6 * found.value:.5g} | {found.gap:.1e} | {wall:.2f} | "
        f"{busy:.2f} |"
    )


def main() -> None:
    """Print the table."""
    study = edtk.load_study(STUDY)
    print("| criterion | tasks | value [1e-3 mm] | proved gap | seconds | of one core |")
    print("|---|--:|--:|--:|--:|--:|")
    for count in (1, TASKS):
        question = study if count == 1 else around(study, count)
        for name in ("rho0", "rho_max"):
            print(row(question, name))


if __name__ == "__main__":
    main()

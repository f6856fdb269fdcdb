"""Draw the pictures of the first page and of the tutorial: `python docs/draw_pictures.py`.

They are the results' own pictures, of the study and the numbers of the tutorial.
"""

from pathlib import Path

import matplotlib
import numpy as np

import edtk

FOLDER = Path(__file__).parent / "pictures"
STUDY = FOLDER.parents[1] / "studies" / "kr270_milling.toml"


def main() -> None:
    """Draw all of them."""
    matplotlib.use("Agg")
    study = edtk.load_study(STUDY)
    plan = edtk.plan(study, size=6)
    sheet = edtk.template(study, plan)
    q = np.deg2rad(sheet.iloc[:, :6].to_numpy())
    deflection = study.model.regressor(q, sheet.iloc[:, 6:12].to_numpy()) @ study.compliances
    noise = 0.03e-3 * np.random.default_rng(0).standard_normal(deflection.shape)
    sheet[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * (deflection + noise)
    calibration = edtk.identify(study, sheet, plan=plan)
    results = {"study": study, "plan": plan, "calibration": calibration}
    for name, result in results.items():
        axes = np.ravel(result.plot())[0]
        axes.get_figure().savefig(FOLDER / f"{name}.png", dpi=90, bbox_inches="tight")


if __name__ == "__main__":
    main()

"""Plans of our own in place of Table 4's, read by Table 6.

`python -m paper_figures.own_plans` searches for them. That takes a few minutes, so its answers lie
beside this file: `own_plans/true_m4.csv` is the plan of four experiments with the least rho0 found
for A0 itself, `own_plans/clipped_m4.csv` that for max(A0, 0).
"""

import sys
from pathlib import Path

from tqdm import tqdm

from edtk import ExactPlan, Plan, Study, criteria
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.study.plan_study import source_of
from edtk.system.workers import open_workers
from paper_figures.example import load_example, target_of
from paper_figures.targets import both

FOLDER = Path(__file__).parent / "own_plans"

# Batches without an improvement after which a search ends; `edtk plan` waits for six.
PATIENCE = 40


def own_plans(study: Study, name: str) -> dict[int, Plan]:
    """The plans for "true" or "clipped" A0 by their number of experiments."""
    return {m: study.load_plan(FOLDER / f"{name}_m{m}.csv") for m in study.specification.sizes}


def search_plan(
    study: Study, name: str, size: int, options: SearchOptions, continuous: bool = True
) -> ExactPlan:
    """The best plan of so many experiments for "true" or "clipped" A0.

    Args:
        study: The example.
        name: Which A0.
        size: Number of experiments.
        options: Seed, patience and workers of the search.
        continuous: Whether the bound is searched for over all poses, and not among candidates.
    """
    criterion = criteria.create("rho0", both(target_of(study))[name])
    candidates = study.specification.candidates
    source = source_of(study, options.seed)
    relaxed = relax_poses(source, candidates, criterion, continuous=continuous)
    return find_plan(relaxed, size, options=options)


def main() -> None:
    """Search for all plans anew, and write them."""
    study = load_example()
    cases = [(name, m) for name in both(target_of(study)) for m in study.specification.sizes]
    with open_workers() as workers:
        bar = tqdm(cases, file=sys.stderr)
        for name, m in bar:
            seed = study.specification.seed
            options = SearchOptions(seed=seed, patience=PATIENCE, workers=workers)
            found = search_plan(study, name, m, options)
            found.plan.to_csv(FOLDER / f"{name}_m{m}.csv", study.robot)
            value = f"{1e3 * found.value:.6g} mm"
            efficiency = f"{100 * found.efficiency:.2f} %"
            bar.write(f"{name}, {m} experiments: {value}, {efficiency} of the bound")


if __name__ == "__main__":
    main()

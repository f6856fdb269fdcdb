"""What a certificate rests its bounds on."""

from dataclasses import dataclass
from typing import Any

from edtk.certificate.recompute.effort import of_sample, require
from edtk.certificate.recompute.plain_data import numbers, rows, table, text, whole
from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array

MOST_SEEDS = 16  # numbers that a seed may consist of
LARGEST = 2**128  # number in a seed, and number of candidates: far more than anybody can draw
MOST_POINTS = 20_000
MOST_PROOFS = 63  # in a certificate


@dataclass(frozen=True, eq=False)
class Proof:
    """Candidates, multipliers and poses of a certificate.

    Attributes:
        candidates: Number of candidates over which a bound is proved.
        seed: Seed of their sequence.
        sampling: "random" or "sobol".
        points: Experiments (k, v) that count as candidates too: those of the relaxation.
        searched: Experiments (k, v) of large sensitivity that a search has found.
        multipliers: The multipliers as they are written, which only a bound needs.
        task_weights: Weights of the tasks to each multiplier as they are written, which only the
            bound of rho_max needs; None without any.
    """

    candidates: int
    seed: list[int]
    sampling: str
    points: Array
    searched: Array
    multipliers: Any
    task_weights: Any

    @classmethod
    def from_dict(cls, content: Any, setting: Setting) -> "Proof":
        """Read the part `proof` of a certificate; experiments that are not allowed do not count.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        keys = ("candidates", "seed", "sampling", "multipliers", "support", "searched")
        content = table(content, keys, "proof", ("task_weights",))
        seed = rows(content["seed"], MOST_SEEDS, "proof.seed")
        if not seed:
            raise ValueError("proof.seed: expected at least one number")
        size = len(setting.fixed) + setting.load.size
        points = {}
        for key in ("support", "searched"):
            rows(content[key], MOST_POINTS, f"proof.{key}")
            x = numbers(content[key], (None, size), f"proof.{key}")
            require(len(x) * of_sample(setting) * MOST_PROOFS, f"the experiments of proof.{key}")
            # A pose that is not allowed could only lower the bound, to the harm of nobody but the
            # one who reads it. It is no candidate.
            points[key] = x[setting.feasible(x)]
        return cls(
            candidates=whole(content["candidates"], 1, LARGEST, "proof.candidates"),
            seed=[whole(part, 0, LARGEST, "proof.seed") for part in seed],
            sampling=text(content["sampling"], ("random", "sobol"), "proof.sampling"),
            points=points["support"],
            searched=points["searched"],
            multipliers=content["multipliers"],
            task_weights=content.get("task_weights"),
        )

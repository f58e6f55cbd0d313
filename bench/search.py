"""The search beside pymoo's NSGA-II at the same budget, and its fronts under noise.

    python bench/search.py [--seeds 10] [--evaluations 2000]

Ratios are of hypervolumes up to the worst values of both fronts and a tenth more, averaged over the seeds.
Under noise of 5 % it prints in how many of the reported fronts a variant is truly dominated by another one.
Needs pymoo (``pip install pymoo``).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize
from pymoo.problems import get_problem

from volery.explore.points import CampaignRow, VariantPoint
from volery.explore.search import front_of, hypervolume, search
from volery.explore.space import Range

PROBLEMS = ("zdt1", "zdt2", "zdt3", "zdt4", "zdt6", "dtlz2")
NOISE = 0.05


def our_search(problem: Any, seed: int, evaluations: int, noise: float = 0.0) -> Any:
    """Return the true objectives of the front that the search reports."""
    space = {
        f"x{n}": Range(float(low), float(high))
        for n, (low, high) in enumerate(zip(problem.xl, problem.xu, strict=True))
    }
    names = [f"f{n}" for n in range(problem.n_obj)]

    def truth(variants: Sequence[Any]) -> Any:
        return problem.evaluate(np.array([[one[name] for name in space] for one in variants]))

    def evaluate(points: Sequence[VariantPoint]) -> list[CampaignRow]:
        rows = []
        for point, exact in zip(points, truth([one.values for one in points]), strict=True):
            random = np.random.default_rng([point.seed, *point.variant.encode()])
            values = exact * (1.0 + noise * random.standard_normal(len(exact)))
            rows.append(CampaignRow(0, point, observables=dict(zip(names, map(float, values), strict=True))))
        return rows

    front = search(
        evaluate, space, [f"minimise {name}" for name in names],
        evaluations=evaluations, seed=seed, confirmations=20 if noise else 0,
    )  # fmt: skip
    return truth([one.values for one in front.solutions])


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--seeds", type=int, default=10)
    options.add_argument("--evaluations", type=int, default=2000)
    options.add_argument("--problems", nargs="+", default=PROBLEMS)
    chosen = options.parse_args()
    print(f"{chosen.evaluations} evaluations, {chosen.seeds} seeds")
    print("problem  ratio of hypervolumes (least, greatest)  noisy fronts with a dominated variant")
    for name in chosen.problems:
        problem = get_problem(name)
        pairs = []
        for seed in range(chosen.seeds):
            theirs = minimize(problem, NSGA2(pop_size=100), ("n_eval", chosen.evaluations), seed=seed).F
            pairs.append((our_search(problem, seed, chosen.evaluations), theirs[front_of(theirs)]))
        end = np.vstack([one for pair in pairs for one in pair]).max(axis=0) * 1.1
        ours, theirs = np.array([[hypervolume(one, end) for one in pair] for pair in pairs]).T
        wrong, sizes = 0, []
        for seed in range(chosen.seeds):
            front = our_search(problem, seed, chosen.evaluations, NOISE)
            wrong += len(front_of(front)) < len(front)
            sizes.append(len(front))
        ratios = ours / theirs
        print(
            f"{name:8} {ours.mean() / theirs.mean():.3f} ({ratios.min():.3f}, {ratios.max():.3f})"
            f"                       {wrong} of {chosen.seeds}, {np.mean(sizes):.0f} variants each",
            flush=True,
        )


if __name__ == "__main__":
    main()

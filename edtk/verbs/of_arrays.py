"""Questions without a robot: problems of arrays, and regions of points."""

import json
from dataclasses import dataclass, replace

import criteria
from edtk.certificate.problem_proofs import region_certificate, require_checkable, store_exact
from edtk.certificate.proof import MOST_MB
from edtk.certificate.verify_exact import has_whole_plans
from edtk.certificate.verify_problem import verify_problem
from edtk.design.enclosure.prove_region import prove_region
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.counts.relax_within import relax_within
from edtk.design.exact.plan_region import RegionPlan
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relax_region import relax_region
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.design.relaxation.search_region import POINTS
from edtk.system.errors import ArgumentError, UserError, whole_number
from edtk.system.parsing import json_text
from edtk.verbs.asked_limits import asked_weight_limits
from edtk.verbs.inputs import CriterionLike, TableAndCertificate, at_hand, given_size, proved_gap
from edtk.verbs.plan_problem import plan_arranged, plan_problem, plan_region
from edtk.verbs.question import OF_PROBLEMS, OF_WEIGHTS, PlanCall, Question, RelaxCall
from edtk.verbs.robust import best_weights, criterion_of, has_ranges, over_ranges

PLANS = 4  # plans over ranges of theta: each is a search of its own


@dataclass(frozen=True)
class OfProblem(Question):
    """Which candidates of a problem of arrays to measure, and how often.

    Attributes:
        problem: The problem.
    """

    problem: Problem
    kind = "problem"

    def plan(self, call: PlanCall) -> ProblemPlan:
        """Counts of candidates; see `edtk.plan`."""
        files = TableAndCertificate(call.out, call.certificate)
        files.require()
        if call.certificate is not None and call.prove is None:
            message = "it is about a proof; expected prove beside it"
            raise ArgumentError(message, argument="certificate")
        if call.certificate is not None:
            require_checkable(self.problem, call.keep is not None)
        call = replace(call, keep=at_hand(self.problem, call.keep))
        options = {name: getattr(call, name) for name in (*OF_PROBLEMS, "prove", "cost_budget")}
        given = {name: value for name, value in options.items() if value is not None}

        def solve(problem: Problem, criterion: criteria.Criterion) -> ProblemPlan:
            seed = 0 if call.seed is None else call.seed
            search = plan_problem if call.errors is None else plan_arranged
            return search(
                problem,
                call.size,
                criterion,
                seed,
                keep=call.keep,
                progress=call.progress,
                **given,
            )

        if has_ranges(self.problem):
            _require_candidates(call)
            found = over_ranges(self.problem, _asked(call.criterion), solve, call.progress, PLANS)
        else:
            criterion = self._criterion(call.criterion)
            if call.certificate is not None and not has_whole_plans(criterion.name):
                message = f"whole plans for {criterion.name} have none; leave it out"
                raise ArgumentError(message, argument="certificate")
            found = solve(self.problem, criterion)
        files.write(lambda: found.to_frame().reset_index(), lambda: _certificate(found))
        return found

    def relax(self, call: RelaxCall) -> Relaxation:
        """Weights of the candidates; see `edtk.relax`."""
        files = TableAndCertificate(call.out, call.certificate)
        files.require()

        def solve(problem: Problem, criterion: criteria.Criterion) -> Relaxation:
            return _weights(problem, criterion, call)

        if has_ranges(self.problem):
            found = over_ranges(self.problem, _asked(call.criterion), solve, call.progress)
        else:
            found = solve(self.problem, self._criterion(call.criterion))
        files.write(lambda: found.to_frame().reset_index(), lambda: _proof(found))
        return found

    def _criterion(self, asked: CriterionLike | None) -> criteria.Criterion:
        return criterion_of(_asked(asked), self.problem, _best)


@dataclass(frozen=True)
class OfRegion(Question):
    """Which points of a region to measure.

    Attributes:
        region: The region.
    """

    region: Region
    kind = "region"

    def plan(self, call: PlanCall) -> RegionPlan:
        """Points with their counts; see `edtk.plan`."""
        files = TableAndCertificate(call.out, None)
        files.require()
        keep = at_hand(self.region, call.keep)

        def solve(region: Region, criterion: criteria.Criterion) -> RegionPlan:
            return plan_region(
                region,
                given_size(call.size),
                criterion,
                0 if call.seed is None else call.seed,
                call.starts,
                keep,
                call.progress,
                proved_gap(call.prove_bound, "prove_bound"),
            )

        if has_ranges(self.region):
            found = over_ranges(self.region, _asked(call.criterion), solve, call.progress, PLANS)
        else:
            found = solve(self.region, self._criterion(call.criterion))
        files.write(found.to_frame, str)
        return found

    def relax(self, call: RelaxCall) -> RelaxedRegion:
        """Points with their weights; see `edtk.relax`."""
        files = TableAndCertificate(call.out, call.certificate)
        files.require()
        given = call.candidates
        points = POINTS if given is None else whole_number(given, "candidates", 2)
        eps = proved_gap(call.prove, "prove")

        def solve(region: Region, criterion: criteria.Criterion) -> RelaxedRegion:
            of_one = criterion.for_size(_number(call.size))
            if eps is None:
                return relax_region(region, of_one, points, progress=call.progress)
            return prove_region(region, of_one, eps, points, call.progress)

        if has_ranges(self.region):
            found = over_ranges(self.region, _asked(call.criterion), solve, call.progress)
        else:
            found = solve(self.region, self._criterion(call.criterion))
        files.write(found.to_frame, lambda: json_text(region_certificate(found)) + "\n")
        return found

    def _criterion(self, asked: CriterionLike | None) -> criteria.Criterion:
        return criterion_of(_asked(asked), self.region, _best)


def _asked(criterion: CriterionLike | None) -> CriterionLike:
    """The criterion, D where none is given."""
    return "D" if criterion is None else criterion


def _require_candidates(call: PlanCall) -> None:
    """Check that experiments of a call are all candidates, each alone.

    Raises:
        ArgumentError: They are not.
    """
    elsewhere = call.keep if isinstance(call.keep, Problem) else None
    beside = {"blocks": call.blocks, "errors": call.errors, "keep": elsewhere}
    for name, value in beside.items():
        if value is not None:
            message = "is not known beside ranges of theta; expected a list of theta"
            raise ArgumentError(message, argument=name)


def _weights(problem: Problem, criterion: criteria.Criterion, call: RelaxCall) -> Relaxation:
    """The best weights within the limits of a call."""
    own = criterion.for_size(_number(call.size))
    has_prior = problem.prior is not None or own.precision is not None
    asked = (getattr(call, name) for name in OF_WEIGHTS)
    limits = asked_weight_limits(problem, has_prior, call.size, *asked)
    if limits is None:
        return replace(relax(problem, own), problem=problem)
    return relax_within(problem, own, limits)


def _best(model: Problem | Region, criterion: criteria.Criterion) -> float:
    """The best value that a criterion can have for one model alone."""
    return best_weights(model, criterion).value


def _proof(found: Relaxation) -> str:
    """The certificate of weights as a text.

    Raises:
        ArgumentError: The second implementation does not confirm it.
    """
    content = json_text(found.to_dict()) + "\n"
    assert found.problem is not None
    claims = verify_problem(json.loads(content), found.problem).claims
    open_claims = [f"{one.claim}: {one.reason}" for one in claims if not one.holds]
    if open_claims:
        message = (
            f"rounding leaves the check no digits to confirm the weights ({open_claims[0]}); leave "
            "it out, or centre the variables"
        )
        raise ArgumentError(message, argument="certificate")
    return content


def _certificate(found: ProblemPlan) -> str:
    """The certificate of a proof as a text.

    Raises:
        UserError: `edtk.verify` would not read it.
    """
    content = json_text(store_exact(found)) + "\n"
    size = len(content) / 1e6
    if size > MOST_MB:
        raise UserError(
            f"a proof of {size:.0f} MB is too large for a certificate of {MOST_MB:g} MB"
        )
    return content


def _number(size: int | None) -> int:
    """Number of experiments that share a prior; one where none is given."""
    return 1 if size is None else whole_number(size, "size", 1)

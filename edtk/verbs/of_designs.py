"""Designs of a study: each verb once, with what differs by kind in methods of their own."""

from abc import abstractmethod
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import product
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

import criteria
from edtk.design.plan import Plan
from edtk.study.study import Study
from edtk.system.errors import ArgumentError, UserError, finite_numbers, whole_number
from edtk.system.time_limit import no_progress, time_left, time_limit
from edtk.system.workers import THIS_PROCESS, Workers
from edtk.verbs.inputs import (
    CriterionLike,
    PlanLike,
    TableAndCertificate,
    as_plan,
    errors_in,
    files_of,
    name_of,
    proved_gap,
    require_output,
    workers_for,
)
from edtk.verbs.question import PlanCall, Question, RelaxCall, seconds_for

if TYPE_CHECKING:
    from edtk.calibration.detect import Promised
    from edtk.calibration.timetable import Day
    from edtk.design.design_space import DesignSpace
    from edtk.design.exact.exact_plan import ExactPlan, OffGuess
    from edtk.design.relaxation.relaxed_plan import RelaxedPlan
    from edtk.study.evaluate import Evaluation
    from edtk.study.give_up import Exchange
    from edtk.study.place_tracker import PlaceSearch
    from edtk.study.plan_study import RunOptions
    from edtk.study.study_run import Designs

FEW = 12  # parameters, up to which two more bounds take seconds
OFF = (0.5, 1.5)  # times the guess of the springs, which may well be 50 % off
# Relative gap of these bounds: what is told is by how many per cent a plan suffers.
OFF_TOLERANCE = 1e-3
SHARE_ALONE = 0.5  # of the time for a plan: that for the first of two criteria alone
SHARE_UNTIL_PROOF = 0.5  # of the time: the plan, before its bound is proved for all poses


def _share_of_plan(call: PlanCall) -> float:
    """The share of the time in which a plan is searched."""
    return 1.0 if call.prove_bound is None else SHARE_UNTIL_PROOF


def _of_parameters(given: CriterionLike | None) -> CriterionLike | None:
    """A criterion as it is; Ds of parameters where names of these stand for it."""
    if not isinstance(given, str) or given in (*criteria.available(), *criteria.families()):
        return given
    names = [name.strip() for name in given.split(",")]
    return {"name": "Ds", "interest": names}


@dataclass(frozen=True)
class OfDesigns(Question):
    """What a study asks of designs: plans, weights, and how good they are.

    Attributes:
        study: The study.
    """

    study: Study

    def asked_for(self, criterion: CriterionLike | None) -> tuple[Study, str | None]:
        """The study that asks for a criterion, and the criterion's name in it.

        A name stands for the criterion with what the study says of it. A table with parameters, or
        a criterion that needs some, becomes the study's own key `criterion`.

        Raises:
            UserError: The study cannot have such a criterion.
            CriterionError: There is no such criterion, or its parameters are wrong.
        """
        if criterion is None or isinstance(criterion, str):
            return self.study, criterion
        if isinstance(criterion, criteria.Criterion):
            if not criterion.needs_parameters:
                return self.study, criterion.name
            criterion = criterion.to_dict()
        name = self._name_of(criterion)
        return self.study.replace(criterion=dict(criterion)), name

    @abstractmethod
    def _name_of(self, criterion: Mapping[str, Any]) -> str:
        """The name of a criterion with parameters, which are checked as far as they can be."""

    @abstractmethod
    def setting(self, criterion: str, space: "DesignSpace | None" = None) -> dict[str, Any]:
        """Robot, load, noise, constraints and tasks of the study as plain data.

        Args:
            criterion: Name of the criterion of the design.
            space: The design space that was searched; defaults to the study's.
        """

    @staticmethod
    @abstractmethod
    def sought() -> "type[Designs]":
        """What searches and runs ask about designs of a study of this kind."""

    def designs(self, study: Study) -> "Designs":
        """The same of a study."""
        return self.sought().of(study)

    def plan(self, call: PlanCall, searched: "ExactPlan | None" = None) -> "ExactPlan":
        """The best plan of exactly so many experiments; see `edtk.plan`.

        Args:
            call: What is asked.
            searched: What a search for it has found already.
        """
        from edtk.study.plan_study import RunOptions

        since = monotonic()
        call = self._with_second(self._checked(call))
        if call.exclude is not None:
            without = replace(self, study=self.study.excluding(call.exclude))
            return without.plan(replace(call, exclude=None))
        asked, criterion = self.asked_for(call.criterion)
        gap = proved_gap(call.prove_bound, "prove_bound")
        faults = self._faults(call.detect or {})
        exchange = self._exchange(asked, criterion, call)
        kept = None if call.keep is None else as_plan(asked, call.keep, "keep", made=True)
        files = TableAndCertificate(call.out, call.certificate, call.rest)
        files.require(*self.study.reads, *files_of(call.keep))
        if call.certificate is not None:
            self._require_certifiable(asked, criterion, call)
        self._require_provable(asked, criterion, call)
        if call.place_tracker:
            return self._placed(call)
        with (
            workers_for(call.workers, call.dask) as pool,
            errors_in(self.study.where),
            time_limit(call.seconds - (monotonic() - since)),
        ):
            options = RunOptions(seed=call.seed, workers=pool, progress=call.progress)
            with time_limit(_share_of_plan(call) * time_left()):
                with time_limit((1.0 if exchange is None else SHARE_ALONE) * time_left()):
                    found = searched or self._best_plan(asked, criterion, kept, call, options)
                if exchange is not None:
                    found = self._given_up(exchange, asked, criterion, call, options, found)
            if gap is not None and found.ended != "interrupted":
                found = self._proved(found, gap, call)
        if call.prove is not None and "interrupted" not in (found.ended, found.proof_ended):
            found = self._proved_on_candidates(found, call)
        try:
            found = self._judged(asked, found, faults)
            found = replace(found, timetable=self.timetable(found.plan))
            found = replace(found, off_guess=self._off_guess(asked, criterion, call, found))
        except KeyboardInterrupt:
            found = replace(found, ended="interrupted")
        files.write(
            lambda: found.whole.to_frame(asked.robot),
            lambda: self._proof(asked, found),
            lambda: found.plan.to_frame(asked.robot),
        )
        return found

    def timetable(self, plan: Plan) -> "Day | None":
        """When a plan's experiments are made; None where the study says nothing of that."""
        from edtk.calibration.timetable import day_of, has_day

        return day_of(self.study, plan) if has_day(self.study) else None

    def _placed(self, call: PlanCall) -> "ExactPlan":
        """The best plan and place of the tracker; what else is asked is told of that plan."""
        from edtk.study.place_tracker import Places, Setup

        places = Places.of(self.study)
        require_output(call.placed_study, *self.study.reads, call.out, call.certificate)
        with (
            workers_for(call.workers, call.dask) as pool,
            errors_in(self.study.where),
            time_limit(call.seconds),
        ):
            with time_limit(_share_of_plan(call) * time_left()):
                found = self._place_search(call, pool).run(places)
            left = None if call.budget is None else time_left()
        placement = found.placement
        assert placement is not None
        set_up = Setup(placement.position, placement.normals)
        there = replace(self, study=set_up.of(self.study))
        rest = replace(call, place_tracker=False, placed_study=None, budget=left)
        whole = there.plan(rest, found)
        if call.placed_study is not None:
            there.study.to_toml(call.placed_study)
        return replace(whole, placement=placement)

    def _place_search(self, call: PlanCall, pool: Workers) -> "PlaceSearch":
        """What a search for a place asks of the study at each."""
        from edtk.design.relaxation.relaxed_plan import RelaxedPlan
        from edtk.study.place_tracker import SEARCH, PlaceSearch
        from edtk.study.plan_study import RunOptions

        options = RunOptions(seed=call.seed, workers=pool, progress=call.progress)
        quiet = replace(options, progress=no_progress)

        def asked_at(study: Study) -> tuple[Study, str | None]:
            return replace(self, study=study).asked_for(call.criterion)

        def planned(study: Study) -> "ExactPlan":
            asked, criterion = asked_at(study)
            return replace(self, study=asked)._best_plan(asked, criterion, None, call, options)

        def relaxed(study: Study) -> RelaxedPlan:
            asked, criterion = asked_at(study)
            few = min(asked.specification.candidates, SEARCH.ranked_poses)
            shared = call.size if self._knows(asked, criterion) else None
            return self._relaxed(asked, criterion, candidates=few, size=shared, options=quiet)

        def cost(study: Study, design: RelaxedPlan | Plan) -> float:
            asked, criterion = asked_at(study)
            designs = self.designs(asked)
            if isinstance(design, Plan):
                return designs.cost(design, criterion)
            space = designs.space(call.size or asked.specification.sizes[0], criterion)
            M = space.problem(design.x).information(design.weights)
            return float(designs.criterion(criterion).cost(M))

        return PlaceSearch(self.study, planned, relaxed, cost, call.progress)

    def _proved(self, found: "ExactPlan", gap: float, call: PlanCall) -> "ExactPlan":
        """The plan with a bound that is proved for all poses."""
        from edtk.design.enclosure.prove_continuum import prove_plan
        from edtk.study.plan_study import study_errors

        said = ""

        def say(stage: str, level: float) -> None:
            nonlocal said
            line = f"{stage} {max(level, 0.0):.1e}"
            if line != said:
                said = line
                call.progress(line, level)

        try:
            with study_errors(self.study):
                proved = prove_plan(found.relaxed.certified, gap, say)
        except KeyboardInterrupt:  # before anything was proved
            return replace(found, ended="interrupted")
        if found.relaxed.without_cell is None:
            return found.beside(proved)
        return found.beside(replace(found.relaxed, without_cell=proved))

    def _proved_on_candidates(self, found: "ExactPlan", call: PlanCall) -> "ExactPlan":
        """The plan with what is proved of all plans of as many experiments on candidates."""
        from edtk.study.plan_study import RunOptions, prove_on_candidates, study_errors

        options = RunOptions(seed=call.seed, progress=call.progress)
        try:
            with errors_in(self.study.where), study_errors(self.study):
                return prove_on_candidates(found, seconds_for(call.prove), call.candidates, options)
        except KeyboardInterrupt:  # before anything was proved
            return replace(found, ended="interrupted")

    def _off_guess(
        self, asked: Study, criterion: str | None, call: PlanCall, found: "ExactPlan"
    ) -> tuple["OffGuess", ...]:
        """How good a plan is where the springs are others than it was designed for.

        Rows of springs are the same whatever these are; what the model leaves out is not, nor how
        far joints with a compensator give way, nor what one of unknown numbers does. Bounds are
        those of a search over all poses, which begins at the best weights for the guess. Nothing is
        said where that takes time that nobody gave, as with many parameters, or experiments cost or
        exist already.
        """
        from edtk.design.exact.exact_plan import OffGuess
        from edtk.study.plan_study import RunOptions

        priced = asked.specification.costs is not None or call.cost_budget is not None
        timed = call.budget is not None or found.ended == "interrupted"
        timed = timed or found.relaxed.space.p > FEW
        if found.kept is not None or priced or timed:
            return ()
        options = RunOptions(seed=call.seed, progress=call.progress)
        size = found.plan.experiments if self._knows(asked, criterion) else None
        each = []
        for of, factor in product(asked.guesses, OFF):
            try:
                other = asked.with_guess_times(factor, of)
            except UserError as error:
                each.append(OffGuess(factor, 0.0, of, error.message))
                continue
            relaxed = self._relaxed(
                other,
                criterion,
                continuous=True,
                size=size,
                tolerance=OFF_TOLERANCE,
                near=found.relaxed.x,
                options=options,
            )
            bound = relaxed.best_bound.scaled(found.plan.experiments)
            cost = self.designs(other).cost(found.plan, criterion)
            each.append(OffGuess(factor, bound.efficiency(cost), of))
        return tuple(each)

    def _knows(self, asked: Study, criterion: str | None) -> bool:
        """Whether something that is known beforehand counts in designs."""
        return self.designs(asked).has_prior(criterion)

    def _checked(self, call: PlanCall) -> PlanCall:
        """The arguments, whose whole numbers are whole.

        Raises:
            ArgumentError: One is not.
        """

        def whole(name: str, least: int) -> int | None:
            given = getattr(call, name)
            return None if given is None else whole_number(given, name, least)

        if call.give_up is not None:
            if call.second is None and self.study.specification.give_up is None:
                message = "expected a second criterion, for which it is given up"
                raise ArgumentError(message, argument="give_up", given=call.give_up)
            if not 0 < call.give_up < 100:
                message = "expected percent between 0 and 100"
                raise ArgumentError(message, argument="give_up", given=call.give_up)
        costs = self.study.specification.costs
        limited = call.cost_budget is not None or (costs is not None and costs.budget is not None)
        if call.cost_budget is not None and finite_numbers(call.cost_budget, "cost_budget").ndim:
            message = "expected one number, as a study has one budget of costs"
            raise ArgumentError(message, argument="cost_budget")
        if call.rest is not None and call.keep is None:
            message = "expected keep beside it; without it all experiments are new"
            raise ArgumentError(message, argument="rest")
        if call.placed_study is not None and not call.place_tracker:
            message = "expected place_tracker beside it"
            raise ArgumentError(message, argument="placed_study")
        if call.place_tracker and call.keep is not None:
            message = (
                "experiments that are kept were read from where the tracker stood; leave them out, "
                "or its place as it is"
            )
            raise ArgumentError(message, argument="keep")
        if call.prove_bound is not None and limited:
            message = "plans within a budget of costs have no bound over all poses; leave this out"
            raise ArgumentError(message, argument="prove_bound")
        return replace(
            call,
            size=whole("size", 1),
            seed=whole("seed", 0),
            distinct=whole("distinct", 1),
            candidates=whole("candidates", 1),
            workers=whole("workers", 1),
        )

    def _with_second(self, call: PlanCall) -> PlanCall:
        """The arguments, with the second criterion that the study says where the call says none."""
        said = self.study.specification.give_up
        if said is None:
            return call
        if call.second is None:
            call = replace(call, second=said.criterion, give_up=call.give_up or said.percent)
        return call

    def _faults(self, given: Mapping[str, str]) -> Any:
        """The faults that were asked for: checked before a long search."""
        from edtk.calibration.detect import sized_faults

        return sized_faults(self.study, given, positions=self.sought().of_visits)

    def _require_certifiable(self, asked: Study, criterion: str | None, call: PlanCall) -> None:
        """Check, before a long search, that its certificate can be written.

        Raises:
            UserError: The criterion has parameters, or says nothing of plans of other sizes.
        """
        from edtk.certificate.certificate import require_certifiable

        require_certifiable(asked, criterion, call.certificate)
        costs = asked.specification.costs
        limited = call.cost_budget is not None or (costs is not None and costs.budget is not None)
        if limited and not criteria.get(criterion or asked.main_criterion).degree:
            raise ArgumentError(
                "plans within a budget of costs have none for this criterion, which is the same "
                "for plans of any size; leave it out",
                argument="certificate",
            )

    def _best_plan(
        self,
        asked: Study,
        criterion: str | None,
        kept: Plan | None,
        call: PlanCall,
        options: "RunOptions",
    ) -> "ExactPlan":
        """The search."""
        from edtk.study.plan_study import plan_study

        return plan_study(
            asked,
            call.size,
            criterion,
            distinct=call.distinct,
            kept=kept,
            budget=call.budget,
            cost_budget=call.cost_budget,
            options=options,
            sought=self.sought(),
        )

    def _relaxed(self, asked: Study, criterion: str | None, **given: Any) -> "RelaxedPlan":
        """The best weights over poses, see `relax_study`."""
        from edtk.study.plan_study import relax_study

        return relax_study(asked, criterion, sought=self.sought(), **given)

    def _require_provable(self, asked: Study, criterion: str | None, call: PlanCall) -> None:
        """Check, before a long search, that whole plans can be proved to be the best.

        Raises:
            UserError: The criterion has no such proof, candidates stand without a proof, or what
                all poses tell has no enclosure for a bound over them.
        """
        if call.prove_bound is not None:
            self._require_enclosed(asked, criterion)
        from edtk.design.exact.counts.limits import Limits
        from edtk.design.exact.prove_exact import require_provable
        from edtk.design.relaxation.relax_poses import DEFAULT_MB, capacity

        if call.prove is None:
            if call.candidates is not None:
                message = "plans move off the candidates; expected prove beside it"
                raise ArgumentError(message, argument="candidates")
            return
        seconds_for(call.prove)
        own = self.designs(asked)
        require_provable(own.named(criterion), Limits(1, np.zeros((1, 1))))
        space = own.base(criterion)
        number = call.candidates or asked.specification.candidates
        held = capacity(space.doubles, space.size, DEFAULT_MB)
        if number > held:
            message = f"expected {held:,} at most, as a proof holds all in {DEFAULT_MB:g} MB"
            raise ArgumentError(message, argument="candidates", given=number)

    def _require_enclosed(self, asked: Study, criterion: str | None) -> None:
        """Check, before a long search, that a bound over all poses can be proved.

        Raises:
            UserError: What poses tell is no polynomial, or the criterion cannot be relaxed.
        """
        from edtk.design.enclosure.prove_continuum import require_enclosed
        from edtk.design.relaxation.relax import require_relaxable
        from edtk.study.plan_study import study_errors

        with study_errors(self.study):
            own = self.designs(asked)
            require_enclosed(own.base(criterion), require_relaxable(own.named(criterion)))

    def _exchange(self, asked: Study, criterion: str | None, call: PlanCall) -> "Exchange | None":
        """The criteria of which one may be given up for the other; None for one alone.

        Raises:
            UserError: The second cannot be one of two, or names what is not unknown.
        """
        from edtk.study.give_up import PERCENT, Exchange
        from edtk.study.tables_of_task import GIVEN_UP

        if call.second is None:
            return None
        own = self.designs(asked)
        designed = replace(self, study=own.designed(criterion))
        other, name = designed.asked_for(_of_parameters(call.second))
        share = (GIVEN_UP if call.give_up is None else call.give_up) / PERCENT
        return Exchange.of(own.named(criterion), self.designs(other).named(name), share)

    def _given_up(
        self,
        exchange: "Exchange",
        asked: Study,
        criterion: str | None,
        call: PlanCall,
        options: "RunOptions",
        alone: "ExactPlan",
    ) -> "ExactPlan":
        """The plan that gives up a part of its criterion for the second one; see `give_up`."""
        from edtk.study.give_up import WEIGHED_POSES, give_up

        if alone.ended == "interrupted":
            return alone
        own = self.designs(asked)
        designed = own.designed(criterion)

        def both(weight: float) -> Study:
            return designed.replace(criterion=exchange.compound(weight))

        def relaxed(study: Study, name: str | None) -> "RelaxedPlan":
            few = min(study.specification.candidates, WEIGHED_POSES)
            quiet = replace(options, progress=no_progress)
            return self._relaxed(study, name, candidates=few, options=quiet)

        def searched(weight: float) -> "ExactPlan":
            return self._best_plan(both(weight), exchange.name, alone.kept, call, options)

        try:
            return give_up(
                exchange,
                alone,
                relaxed(asked, criterion),
                lambda weight: relaxed(both(weight), exchange.name),
                searched,
                lambda found: own.information(found.whole, criterion),
            )
        except KeyboardInterrupt:
            return replace(alone, ended="interrupted")

    def _judged(self, asked: Study, found: "ExactPlan", faults: Any) -> "ExactPlan":
        """The plan with its errors in the task, and with the chances that faults are noticed."""
        from edtk.calibration.detect import detect

        judged = detect(self._promised(asked, found), faults) if faults else ((), ())
        promised = self.calibrations(asked, found).promised(found)
        return replace(promised, detections=judged[0], separations=judged[1])

    @abstractmethod
    def _promised(self, asked: Study, found: Any) -> "Promised":
        """The readings of a plan without their values."""

    @abstractmethod
    def calibrations(self, study: Study, found: Any = None) -> "Designs":
        """The designs of a study, which know what else is uncertain in a calibration by them.

        Args:
            study: The study.
            found: A plan of it, if one was found.
        """

    def _proof(self, asked: Study, found: Any) -> str:
        """The certificate of a plan, with a proof for each set of loads that a budget pays for."""
        from edtk.certificate.certificate import certificate_text

        relaxed = found.relaxed.certified
        setting = replace(self, study=asked).setting(relaxed.criterion.name, relaxed.space)
        if found.day is None:
            return certificate_text(asked, found, setting)
        return certificate_text(asked, found, setting, found.day, found.proofs)

    def relax(self, call: RelaxCall) -> "RelaxedPlan":
        """The best weights over poses; see `edtk.relax`."""
        from edtk.design.relaxation.relax_poses import PlanInterrupted
        from edtk.study.plan_study import RunOptions

        limit = time_limit(seconds_for(call.budget, "budget"))
        files = TableAndCertificate(call.out, call.certificate)
        files.require(*self.study.reads)
        prove = proved_gap(call.prove, "prove")
        asked, criterion = self.asked_for(call.criterion)
        if call.certificate is not None:
            from edtk.certificate.certificate import require_certifiable

            require_certifiable(asked, criterion, call.certificate)

        def write(found: "RelaxedPlan") -> None:
            files.write(found.to_frame, lambda: self._proof_of_weights(asked, found))

        options = RunOptions(seed=call.seed, threads=call.workers, progress=call.progress)
        try:
            with self._sweepers(call) as pool, errors_in(self.study.where), limit as limited:
                found = self._relaxed(
                    asked,
                    criterion,
                    candidates=call.candidates,
                    continuous=call.continuous,
                    prove=prove,
                    size=call.size,
                    memory_mb=call.memory_mb,
                    options=replace(options, workers=pool),
                )
        except PlanInterrupted as interrupt:
            interrupt.best = replace(interrupt.best, ended="interrupted")
            write(interrupt.best)
            raise
        if limited.cut:
            found = replace(found, ended="budget")
        write(found)
        return found

    @staticmethod
    def _sweepers(call: RelaxCall) -> AbstractContextManager[Workers]:
        """The workers that were asked for; this process by default."""
        if call.workers is None and call.dask is None:
            return nullcontext(THIS_PROCESS)
        return workers_for(call.workers, call.dask)

    def _proof_of_weights(self, asked: Study, found: "RelaxedPlan") -> str:
        """The certificate of a relaxation."""
        from edtk.certificate.certificate import certificate_text

        setting = replace(self, study=asked).setting(found.criterion.name, found.space)
        return certificate_text(asked, found, setting)

    def evaluate(self, plan: PlanLike) -> "Evaluation":
        """A plan under every criterion; see `edtk.evaluate`."""
        with errors_in(name_of(plan, "plan")):
            return self.calibrations(self.study).evaluate(as_plan(self.study, plan))

    def efficiency(self, plan: Plan, of: Plan) -> tuple[str, float | None]:
        """The criterion by which plans are judged, and how good a plan is by it beside another.

        Args:
            plan: The plan.
            of: The other one.

        Returns:
            Name of the criterion, and cost of the other plan by the cost of this one; None where a
            plan leaves open what the criterion is about.
        """
        designs = self.designs(self.study)
        criterion = designs.criterion()
        costs = [designs.cost(one) for one in (of, plan)]
        known = bool(np.isfinite(costs).all()) and min(costs) > 0
        return criterion.name, costs[0] / costs[1] if known else None

"""Force by length, or displacement, and pressure: a force balance solved for its load.

Unlike a static law it remembers: friction and what relaxes come from the balance, at held length
through the stretch of the wall. Its errors of force are what is made least. Every run begins where a
machine holds the muscle, without pressure. Solved for the pressure it is a compensator
(`mckibben.blocks.coupled.load_estimate.ForceCompensator`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, ClassVar

from annotated_types import Interval

from mckibben.blocks.base import Block
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.blocks.fields import Channel
from mckibben.blocks.memoryless import Affine
from mckibben.channels import Channels
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import SearchEstimator
from mckibben.estimators.coupled.balance import BalanceEstimator, fixed_in
from mckibben.estimators.coupled.balance_prior import PriorLike, as_prior
from mckibben.estimators.coupled.base import FEWEST_IN_A_ROW
from mckibben.numerics.tracker import Tracker
from mckibben.recording import Recording, base_name


class BalanceForceEstimator(SearchEstimator):
    """Force by length or displacement and pressure, from a force balance.

    Parameters
    ----------
    pressure : str
        Channel of the pressure.
    n_stops : int
        Friction elements.
    n_lags : int
        Time constants of what relaxes; 0 for a muscle without time.
    elasticity : int
        Degree of the elastic polynomial.
    area : int
        Degree of the area's.
    terms : sequence of str, optional
        Kinds of terms that may be added, as of `balance`.
    prior : str, Path, Sheet or Prior, optional
        What is likely before, as `balance` takes it.
    """

    title = "Force from a balance of forces"
    purpose = "force"
    can = (
        "Force by length, or displacement, and pressure: a force balance solved for its "
        "load, with friction and relaxation."
    )
    cannot = (
        "At constant length only friction makes loops; beyond the recorded lengths its area is "
        "extrapolated linearly."
    )
    inverse_kind = "exact"
    quick = True

    input: str = "length"
    output: str = "force"
    pressure: str = "pressure"
    n_stops: Annotated[int, Interval(ge=0, le=30)] = 8
    n_lags: Annotated[int, Interval(ge=0, le=10)] = 6
    elasticity: Annotated[int, Interval(ge=1, le=9)] = 9
    area: Annotated[int, Interval(ge=0, le=6)] = 4
    terms: tuple[str, ...] | None = None
    prior: PriorLike = None

    effort: ClassVar[float] = 1.0
    errors_known: ClassVar[bool] = False
    input_settings: ClassVar[tuple[str, ...]] = ("pressure",)

    @classmethod
    def objection(cls, recordings: Sequence[Recording], channels: Channels) -> str | None:
        roles = cls.own_roles(channels)
        kinds = [base_name(name) for name in (*roles.inputs, *roles.outputs)]
        if kinds not in (["length", "force"], ["displacement", "force"]):
            return "it maps length, or displacement, to force"
        return super().objection(recordings, channels)

    def fixed(self, block: Block) -> tuple[int, ...]:
        return fixed_in(block)

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        position, (pressure,) = data.inputs[0], data.scheduled
        balance = BalanceEstimator(
            of_force=True,
            n_stops=self.n_stops,
            n_lags=self.n_lags,
            elasticity=self.elasticity,
            area=self.area,
            terms=self.terms,
            prior=self.prior,
        )
        rest_length = None
        if position.name.startswith("length"):
            has_prior = self.prior is not None
            rest_length = (
                as_prior(self.prior).sheet.rest_length_mm if has_prior else data.input_range[1]
            )
        displacement = position if rest_length is None else Channel("displacement", position.unit)
        runs = tuple(
            replace(
                run,
                driven=run.scheduled,
                outputs=run.driven if rest_length is None else rest_length - run.driven,
                scheduled=run.outputs,
            )
            for run in data.runs
        )
        muscle = replace(
            data,
            runs=runs,
            inputs=(pressure,),
            outputs=(displacement,),
            scheduled=data.outputs,
            spans=balance.spans,
        ).stretches(FEWEST_IN_A_ROW - 1)  # a force that does not count is not to be given as a load
        force = load_of(balance.find(muscle, tracker))
        if rest_length is None:
            return force
        shortening = Affine(-1.0, rest_length, position, displacement)
        before = PerChannel((shortening, Affine(1.0, 0.0, pressure, pressure)))
        return Series((before, *(force.parts if isinstance(force, Series) else (force,))))

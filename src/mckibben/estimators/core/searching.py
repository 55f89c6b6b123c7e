"""Settings of estimators that search: by least squares from many starts, or by particle swarm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge

from mckibben.estimators.core.single import SingleEstimator
from mckibben.estimators.optimisers.swarm import Swarm


@dataclass(kw_only=True, repr=False, eq=False)
class SearchingEstimator(SingleEstimator):
    """An estimator with non-linear parameters.

    Parameters
    ----------
    method : {"ls", "pso-ls", "pso"}
        Bounded least squares from many starts with linear parameters solved for; particle swarm on
        the non-linear parameters only, the linear ones solved for; particle swarm on all parameters,
        as the papers do it.
    pso_particles, pso_iterations : int
        Size of the swarm, and moves.
    pso_inertia_start, pso_inertia_end : float
        Inertia, falling linearly.
    pso_c1, pso_c2 : float
        Pull to the particle's own best, and to the swarm's.
    """

    method: Literal["ls", "pso-ls", "pso"] = "ls"
    pso_particles: Annotated[int, Ge(2)] = 20
    pso_iterations: Annotated[int, Ge(1)] = 50
    pso_inertia_start: float = 0.9
    pso_inertia_end: float = 0.4
    pso_c1: Annotated[float, Ge(0)] = 2.0
    pso_c2: Annotated[float, Ge(0)] = 2.0

    @property
    def swarm(self) -> Swarm:
        """The settings of the particle swarm."""
        inertia = (self.pso_inertia_start, self.pso_inertia_end)
        return Swarm(self.pso_particles, self.pso_iterations, inertia, self.pso_c1, self.pso_c2)

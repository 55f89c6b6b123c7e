"""The terms of a force balance: one table, from which all else that is said of a term is made.

A term belongs to a coordinate, to a muscle, to all, or to the front before the muscles. Its row has its
unit, label, symbol, sign, range and natural scale, and what it adds to the equation. Made from the table
are the layout of the coefficients, which kernels in Python and in C read by the names of places below;
the checks, labels, units and equations of a block; the unknowns, bounds and scales of identification.
"""

from __future__ import annotations

from functools import cache
from math import inf, log
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.intp]

NEVER = 1e30
"""Slack force of muscles that never go slack."""

# -- the table -----------------------------------------------------------------------------------


class Kind(NamedTuple):
    """A kind of term.

    Parameters
    ----------
    name : str
        The field of a balance.
    of : {"coordinate", "muscle", "all", "front"}
        What has numbers of its own.
    width : str
        The number of them: an attribute of `Sizes`.
    unit, symbol, label : str
        Of the first number, or of those that have no other.
    option : str
        What adds it in identification; empty if it is there from the start, or none that is found.
    equation : str
        What it adds to the force balance.
    least, most, scale : float
        Range and natural scale, over the natural size of its unit.
    linear : bool
        Whether the force is linear in it.
    log : bool
        Whether its logarithm is found.
    prior : bool
        Whether the prior of a muscle determines it.
    doubtful : bool
        Whether it is none, give or take its natural scale, unless data say otherwise.
    alike : bool
        Whether all muscles have the same of it where they are identified.
    needs : {"", "time", "stops", "hold"}
        What it has no effect without: sample times, stops, or what holds a muscle against its pull.
    phenomenon : str
        What it shows: data have to demand it, and one form of it at most; empty if it acts smoothly.
    begins : tuple of float
        Where a phenomenon is tried, as shares of its natural size.
    excludes : str
        The phenomenon that it cannot be there beside.
    like_friction : bool
        Whether it resembles friction: then it is tried before all others, and else only after them.
    """

    name: str
    of: Literal["coordinate", "muscle", "all", "front"]
    width: str
    unit: str
    symbol: str
    label: str
    option: str = ""
    equation: str = ""
    least: float = -inf
    most: float = inf
    scale: float = 1.0
    linear: bool = True
    log: bool = False
    prior: bool = False
    doubtful: bool = True
    alike: bool = False
    needs: Literal["", "time", "stops", "hold"] = ""
    phenomenon: str = ""
    begins: tuple[float, ...] = ()
    excludes: str = ""
    like_friction: bool = False

    @property
    def notation(self) -> str:
        """Symbol and unit, as in the annotation of a field; see `mckibben.blocks.notation`."""
        return f"{self.symbol} [{self.unit}]"

    def units(self, sizes: Sizes) -> tuple[str, ...]:
        """Return the units of the numbers that a coordinate or muscle has of it, or all have."""
        if self.name == "springs":
            return sizes.powers * ("N", *sizes.coordinates * (self.unit,))
        if self.name == "obstacles":
            return sizes.obstacles * ("", "mm", *(1 + sizes.schedules) * (self.unit,))
        return sizes.number(self.width) * (self.unit,)


MOST_RATIO = log(5.0)
"""Largest logarithm of the ratio of a parameter on the way down to that on the way up."""

_PLACES = (0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95)
_OBSTACLE = r"\sum_n o_{kn} \left[y_k - \xi_{kn}\right]_{\sigma_{kn}}"
_LINE = r"l_k \left(\frac{A_k}{a_{k0}}\right)^2 \dot{y}_k"

# fmt: off
TABLE = {kind.name: kind for kind in (
    Kind("loads", "coordinate", "loads", "N", "C_{kl}", "share", "",
         r"\sum_l C_{kl} F_l", doubtful=False),
    Kind("springs", "coordinate", "springs", "N/mm", "S_{ki}", "spring", "springs"),
    Kind("obstacles", "coordinate", "met", "N/mm", "o_{kn}", "obstacle", "obstacle", _OBSTACLE, 0.0,
         phenomenon="obstacle"),
    Kind("elasticity", "muscle", "elastic", "N", "e_{ki} from 2", "elasticity", "elasticity",
         "E_k(y_k)", prior=True),
    Kind("areas", "muscle", "area", "N/bar", "a_{ki} from 0", "area", "areas", prior=True),
    Kind("friction", "muscle", "stops", "N/mm", "h_{km}", "stop", "",
         r"\sum_m h_{km} s_{km}", 0.0, prior=True),
    Kind("relaxation", "muscle", "lags", "N/mm", r"\kappa_{kl}", "relaxation", "relaxation",
         r"\sum_l \kappa_{kl} z_{kl}", 0.0, prior=True),
    Kind("damping", "muscle", "one", "N s/mm", "d_k", "damping", "", r"d_k \dot{y}_k", 0.0,
         needs="time"),
    Kind("lines", "muscle", "one", "N s/mm", "l_k", "resistance of the line", "line", _LINE, 0.0,
         alike=True, needs="time"),
    Kind("mass", "muscle", "one", "N s^2/mm", "m_k", "mass", "mass", r"m_k \ddot{y}_k", 0.0,
         alike=True, needs="time", phenomenon="mass", begins=(0.0,), excludes="slack"),
    Kind("bladders", "muscle", "one", "N/mm", "b_k", "spring of the bladder", "", "", 0.0),
    Kind("friction_growth", "all", "one", "", r"\lambda", "friction growth", "", "", 0.0, 1.0,
         linear=False, needs="stops"),
    Kind("friction_slopes", "all", "schedules", "", "g_i", "friction growth",
         "friction_slopes", "", 0.0, 4.0, linear=False, needs="stops"),
    Kind("asymmetry", "all", "one", "", r"\rho", "asymmetry", "asymmetry", "", -MOST_RATIO, MOST_RATIO,
         linear=False, log=True, needs="stops", phenomenon="asymmetry", begins=(0.0,),
         like_friction=True),
    Kind("lags", "all", "lags", "s", r"\tau_l", "lag", "relaxation", "", linear=False, log=True),
    Kind("walls", "muscle", "one", "mm/bar", "w_k", "stretch of the wall", "walls", "", 0.0, 1.0,
         0.2, linear=False, alike=True, needs="stops", like_friction=True),
    Kind("pushes", "muscle", "one", "N", "Q_k", "force of slackening", "slack", "",
         linear=False, doubtful=False, needs="hold", phenomenon="slack", begins=(0.5, 0.95),
         excludes="mass"),
    Kind("places", "coordinate", "obstacles", "mm", "", "place", "obstacle", "", scale=0.2,
         linear=False, phenomenon="obstacle", begins=_PLACES),
    Kind("filling", "front", "one", "s", "", "filling", "filling", "", 0.0, 2.0, linear=False,
         needs="time"),
    Kind("venting", "front", "one", "", "", "venting", "venting", "", -MOST_RATIO, MOST_RATIO,
         linear=False, log=True, needs="time"),
    Kind("dead", "front", "one", "bar", "", "dead zone", "dead", "", 0.0, 0.5, 0.1, linear=False,
         phenomenon="dead zone", begins=(0.1, 0.2, 0.35)),
    Kind("contact", "front", "one", "bar", "", "contact", "contact", "", 0.0, 0.5, 0.1,
         linear=False, phenomenon="dead zone", begins=(0.2,)),
)}
# fmt: on
"""All terms, by name."""

PHENOMENA = tuple(dict.fromkeys(kind.option for kind in TABLE.values() if kind.phenomenon))
"""Options whose terms data have to demand."""

ORDER = {
    "all": {
        "limits": "stops",
        "decays": "lags",
        "gains": "lags",
        "friction_slopes": "",
        "drive": "pressures",
    },
    "coordinate": dict.fromkeys(("springs", "loads", "obstacles"), ""),
    "muscle": {"hull": "two", "walls": "", "pushes": "", "directions": "coordinates"}
    | dict.fromkeys(("damping", "lines", "mass", "bladders"), "")
    | dict.fromkeys(("elasticity", "areas", "friction", "relaxation"), ""),
}
"""What coefficients there are behind the head, in order, and their number where no term has it."""

LINEAR = {
    owner: tuple(name for name in parts if name in TABLE and TABLE[name].linear)
    for owner, parts in ORDER.items()
}
"""Terms that forces are linear in, of coordinates and muscles, in the order of coefficients."""

NONLINEAR = tuple(name for name, kind in TABLE.items() if not kind.linear)
"""All others."""


# -- where coefficients and states are -------------------------------------------------------------

(N_MUSCLES, N_COORDINATES, N_SCHEDULES, DEGREE, N_LOADS, N_STOPS, N_LAGS, N_ELASTIC, N_AREAS,
 N_OBSTACLES, N_DRIVEN, N_MOVES) = range(12)  # fmt: skip
"""Sizes, in the order of `Sizes`."""

COORDINATES, COORDINATE_SIZE, MUSCLES, MUSCLE_SIZE, DECAYS, GAINS, SLOPES, DRIVE = range(12, 20)
"""Where the numbers of the first coordinate and muscle are, and how many each has; where those of all
are: decays and gains of lags, slopes of friction by what schedules, the middle of the recorded
pressures and behind it their covariance.
"""

AREA, STOP, LAG, N_TERMS, WORK = range(20, 25)
"""Which of a muscle's force terms are the first of its area, its stops and its lags; their number;
how much `solve_equilibrium` needs to compute in.
"""

STOPS, LAGGING, MOVED, TARE = range(25, 29)
"""Where in the state the stops are, what lags, the last two moves, and the tare."""

(SCALE, GROWTH, TOP, RATIO, LOWEST, HIGHEST, RATE, TARED, UNSETTLED, PRELOAD, DIRECTED, HELD,
 LIMITS) = range(29, 42)  # fmt: skip
"""Scale of polynomials, lambda, P, ratio of lower to upper limits, ends of pressures, samples a second,
whether there is a tare, what is left at the start to relax (1, or 0 if settled), pressure shared by
muscles that are more than coordinates, whether they are, whether they start held; limits of stops.
"""

SIDE, PLACE, STIFFNESS = range(3)
"""Numbers of an obstacle: 1 on the way up or -1, where, and its stiffness; then by what schedules."""

SHORTEST, LONGEST, WALL, PUSH, WAYS = range(5)
"""Numbers of a muscle: ends of the known shortening, stretch of the wall, force at which it goes slack,
shortening by each coordinate; then coefficients of its terms.
"""

DAMPING, LINE, MASS, BLADDER, ELASTIC = range(5)
"""A muscle's first force terms."""

FRESH, FAILED = -2, -1
"""Last states: whether this is the first sample, and the number of samples without a solution."""


class Sizes(NamedTuple):
    """Numbers of what a balance has.

    Coefficients of elasticity and area, obstacles of a coordinate, directions in which more muscles
    than coordinates were driven, and 2 past moves if there is damping or mass.
    """

    muscles: int
    coordinates: int
    schedules: int
    degree: int
    loads: int
    stops: int
    lags: int
    elastic: int
    area: int
    obstacles: int
    driven: int = 0
    moves: int = 0

    @property
    def powers(self) -> int:
        """The constant, and all powers of what schedules."""
        return 1 + self.schedules * self.degree

    @property
    def springs(self) -> int:
        """A constant and springs to all coordinates, by every power of what schedules."""
        return self.powers * (1 + self.coordinates)

    @property
    def obstacle(self) -> int:
        """Numbers of an obstacle."""
        return 1 + STIFFNESS + self.schedules

    @property
    def met(self) -> int:
        """Numbers of all obstacles of a coordinate."""
        return self.obstacles * self.obstacle

    @property
    def pressures(self) -> int:
        """Numbers of a drive."""
        return self.muscles * (1 + self.muscles) if self.driven else 0

    def number(self, width: str) -> int:
        """Return the number of a width."""
        return {"one": 1, "two": 2}.get(width) or int(getattr(self, width))

    def of(self, owner: str) -> int:
        """Return the number of coordinates or muscles; 1 for all others."""
        return {"coordinate": self.coordinates, "muscle": self.muscles}.get(owner, 1)


class Layout(NamedTuple):
    """Where the numbers of a balance are.

    Parameters
    ----------
    at : dict of str to array of int, shape (coordinates, muscles or 1, numbers)
        Places of the coefficients.
    head : tuple of int
        Sizes and places, the first coefficients.
    size, n_states : int
        Number of coefficients and states.
    """

    at: dict[str, Indices]
    head: tuple[int, ...]
    size: int
    n_states: int


@cache
def layout(sizes: Sizes) -> Layout:
    """Return where the numbers of a balance of these sizes are."""
    n, m = sizes.muscles, sizes.coordinates
    at, first, begun, end = dict[str, Indices](), dict[str, int](), list[int](), LIMITS
    for owner, parts in ORDER.items():
        widths = {part: sizes.number(by or TABLE[part].width) for part, by in parts.items()}
        own, count = sum(widths.values()), sizes.of(owner)
        begun += [end, own] if owner != "all" else []
        for part, width in widths.items():
            first[part] = end
            at[part] = end + own * np.arange(count)[:, np.newaxis] + np.arange(width)
            end += width
        end += (count - 1) * own
    shared = [first[part] for part in ("decays", "gains", "friction_slopes", "drive")]
    terms = [first[part] - first["damping"] for part in ("areas", "friction", "relaxation")]
    n_terms = terms[-1] + sizes.lags
    # of every coordinate the residual, the step, the start of a search, and the size of forces; the
    # slopes of the residual; values and slopes of a muscle's terms
    work = 4 * m + m * m + 2 * n_terms
    stops, lagging = n + m, n + m + n * sizes.stops
    moved = lagging + n * sizes.lags
    tare = moved + n * sizes.moves
    head = *sizes, *begun, *shared, *terms, n_terms, work, stops, lagging, moved, tare
    return Layout(at, head, end, n_states=tare + m + 2)

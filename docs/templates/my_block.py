"""The elastic-plastic model: a spring beside a spring that slips, and its exact inverse.

y = gain u + weight E_r[u], where the stop operator E_r[u] = u - F_r[u] follows the input until it
reaches r, then slips; F_r is the play operator of the same threshold.

Source: write here the title of the paper and the numbers of its equations, and own up to every
departure from it. Numbers and units stand in the docstring of the class.

--- For the author: copy this file into the room of its family in src/mckibben/blocks, rename what is
--- in it, and keep its order: what is modelled and where it comes from, the kernels, the class.
--- Comments that start with three dashes are for you; take them out.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel, Start
from mckibben.blocks.fields import DISPLACEMENT, PRESSURE, STRICT, ChannelField, StoredInitial
from mckibben.blocks.inverse import Invertible, check_input_range
from mckibben.blocks.kernels import SLACK, kernel, step
from mckibben.blocks.notation import Notation
from mckibben.blocks.solving import solved_start
from mckibben.errors import ModelError


# --- A kernel takes one sample: coefficients in, state changed in place, outputs filled. It allocates
# --- nothing. simulate, stream, simulate_many and C are all made from it, so they agree to the bit: it
# --- is written in a small part of Python, see docs/kernels.md.
# --- Use summing_step instead where many weighted operators are added up: it vectorises.
@step
def elastic_plastic_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run the model; coefficients are [gain, weight, r], the state is the play operator's output."""
    gain, weight, r = coefficients[0], coefficients[1], coefficients[2]
    u = inputs[0]
    state[0] = min(max(state[0], u - r), u + r)
    outputs[0] = gain * u + weight * (u - state[0])


@step
def elastic_plastic_inverse_step(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Invert the model; coefficients are [forward ones, lowest, highest input].

    The state is [play operator's output, samples clipped].
    """
    gain, weight, r = coefficients[0], coefficients[1], coefficients[2]
    lowest, highest = coefficients[3], coefficients[4]
    slack = SLACK * (highest - lowest)
    y, s = inputs[0], state[0]
    u = (y + weight * s) / (gain + weight)
    if u > s + r:
        u = (y - weight * r) / gain
    elif u < s - r:
        u = (y + weight * r) / gain
    if u < lowest - slack or u > highest + slack:
        state[1] += 1.0
    u = min(max(u, lowest), highest)
    state[0] = min(max(s, u - r), u + r)
    outputs[0] = u


# --- Memory is always explicit: a rule by name, which a start fills in, or the state itself.
@kernel
def elastic_plastic_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start as if the input had only risen to the first sample, or as if nothing had happened."""
    u, r = inputs[0], coefficients[2]
    state[0] = min(max(0.0, u - r), u + r) if virgin else u - r


# --- That of the inverse seeks the input at which the block gives the first reference, by bisection. It
# --- asks for the output that an input gives where the block has been started with it.
@kernel
def _first_output(u: float, memory: tuple[Array, Array]) -> float:
    c, state = memory
    return c[0] * u + c[1] * (u - state[0])


elastic_plastic_inverse_start = solved_start(_first_output, elastic_plastic_start, 1)


# --- A block is a frozen dataclass of its parameters. STRICT refuses unknown fields, numbers that are
# --- not finite, and silent conversions: that is what makes saved files safe to load.
@dataclass(frozen=True, config=STRICT)
class ElasticPlastic(Invertible):
    """Elastic-plastic model.

    Parameters
    ----------
    gain : float
        Output per input while slipping; positive.
    weight : float
        What output per input rises by while sticking. The inverse wants gain + weight > 0.
    threshold : float
        Travel of the input from the middle to slipping, in its unit; at least 0.
    input_range : (float, float), optional
        Lowest and highest input that may be asked for; the inverse clips there. Default none.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample.
    input, output : Channel
        Channel driven and channel given.
    """

    # --- The name in the registry and in saved files; it never changes once there are files.
    kind: ClassVar[str] = "elastic-plastic"
    kernel: ClassVar[Kernel] = elastic_plastic_step
    start_kernel: ClassVar[Start] = elastic_plastic_start
    inverse_kernel: ClassVar[Kernel] = elastic_plastic_inverse_step
    inverse_start_kernel: ClassVar[Start] = elastic_plastic_inverse_start
    # --- What the parameter vector is made of, and, as here it is all that the kernel reads, its
    # --- coefficients; else override coefficients().
    parameters: ClassVar[tuple[str, ...]] = ("gain", "weight", "threshold")
    # --- How it is written: equations in LaTeX, then the symbol and unit of every number in them. What
    # --- a number means, the docstring above says; both together make the tables of parameters.
    notation: ClassVar[Notation] = Notation(
        r"y = g u + w E_r[u],\quad E_r[u] = u - F_r[u]",
        gain="g [{y}/{u}]",
        weight="w [{y}/{u}]",
        threshold="r [{u}]",
    )
    # --- Where time matters: rate_dependent: ClassVar[bool] = True, and coefficients() turns the
    # --- sample time into what the kernel needs; see blocks/hysteresis/pi.py.

    gain: Annotated[FiniteFloat, Gt(0)]
    weight: FiniteFloat
    threshold: FiniteFloat
    input_range: tuple[FiniteFloat, FiniteFloat] | None = None
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        if self.threshold < 0:
            raise ModelError(
                f"the threshold of {self.kind!r} is {self.threshold:g}. Remedy: give at least 0."
            )
        check_input_range(self.kind, self.input_range)

    @property
    def n_states(self) -> int:
        """The play operator's output."""
        return 1

    def peaks(self) -> Array:
        """Return the peak from which the operator just comes back to the lowest input."""
        return np.array([self.input_limits[0] + 2 * self.threshold])

    # --- Without an inverse, leave out its kernels and what follows, and derive from Block. One to be
    # --- solved for in every sample declares `solved`; see blocks/hysteresis/eupi.py.
    # --- An error says which condition fails, and ends with the remedy.
    def check_invertible(self) -> None:
        """Demand that the output rises with the input."""
        slope = self.gain + self.weight
        if slope <= 0:
            raise ModelError(
                f"'elastic-plastic' has no inverse: gain and weight add up to {slope:g}, so its output "
                "would not rise with its input. Remedy: identify it with a weight above -gain."
            )

    # --- The inverse's coefficients are this model's, then the limits; its state is this model's, then
    # --- the count of clipped samples. What differs is declared; see blocks/inverse.py.

    # --- Contract tests run on the example: make it small and typical.
    @classmethod
    def example(cls) -> Self:
        """Return the shape of a stiff little muscle over 0 to 5 bar."""
        return cls(4.0, -1.5, 0.4, (0.0, 5.0))

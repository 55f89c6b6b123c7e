"""A plan: what to record next, which part is for what, and what is expected of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mckibben.recording import Recording


@dataclass(frozen=True)
class Parameter:
    """A parameter, and its expected standard errors relative to its value, now and after."""

    name: str
    value: float
    now: float
    after: float


@dataclass(frozen=True)
class Step:
    """A stretch of a plan: from and to when [s], what is done, and what for."""

    start: float
    stop: float
    what: str
    why: str


@dataclass(frozen=True)
class Plan:
    """What to record next.

    Parameters
    ----------
    recording : Recording
        The commands, with time.
    parameters : tuple of Parameter
        With their expected errors.
    errors : dict
        By output, expected errors of free-running predictions now and after, in its unit.
    random : dict
        The same after as much random motion.
    units : dict
        Of outputs.
    steps : tuple of Step
        Which part is for what.
    notes : tuple of str
        What the user should know.
    interrupted : bool
        Whether the search was stopped; the plan is then the best until there.
    goal : str or None
        Parts of the names of parameters that it is for, rather than predictions.
    """

    recording: Recording
    parameters: tuple[Parameter, ...]
    errors: dict[str, tuple[float, float]]
    random: dict[str, float]
    units: dict[str, str]
    steps: tuple[Step, ...]
    notes: tuple[str, ...]
    interrupted: bool
    goal: str | None

    @property
    def sentence(self) -> str:
        """What it is good for, in words."""
        found = []
        for name, (now, after) in self.errors.items():
            found.append(
                f"{name} {after:.3g} {self.units[name]}".strip() + f" instead of {now:.3g}"
            )
        said = (
            f"After these {self.recording.duration:.0f} s, predictions of random motion should be off, "
            f"as far as the model's form is right, by: {', '.join(found)}"
        )
        told = [
            f"{one.name} (standard error from {_share(one.now)} to {_share(one.after)})"
            for one in self.learned[:3]
        ]
        return (
            f"{said}. {'Most is' if self.goal is None else 'It is'} learned of {'; '.join(told)}."
        )

    @property
    def learned(self) -> list[Parameter]:
        """The parameters that it is for, or all, those first of which most is learned."""
        parts = [part.strip() for part in (self.goal or "").split(",")]
        named = [one for one in self.parameters if any(part in one.name for part in parts)]
        return sorted(named, key=lambda one: one.after / one.now)

    def to_dict(self) -> dict[str, Any]:
        """Return all but the samples, as JSON holds it."""
        return {
            "seconds": self.recording.duration,
            "sentence": self.sentence,
            "errors": {
                name: {"now": now, "after": after, "after_random_motion": self.random[name]}
                for name, (now, after) in self.errors.items()
            },
            "parameters": [vars(one) for one in self.parameters],
            "steps": [vars(one) for one in self.steps],
            "start": {name: float(v[0]) for name, v in self.recording.channels.items()},
            "interrupted": self.interrupted,
            "notes": list(self.notes),
        }


def _share(value: float) -> str:
    return f"{100 * value:.2g} %" if value < 1 else f"{100 * value:.0f} %"

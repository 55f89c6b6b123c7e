"""How far a comparison is, in words."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Standing:
    """How far a comparison is.

    Parameters
    ----------
    done, total : int
        Models.
    fitting : tuple of str
        Models in work, the latest last.
    best : str
        The model that would be chosen so far, and by what figure; empty before there is one.
    """

    done: int
    total: int
    fitting: tuple[str, ...] = ()
    best: str = ""

    @property
    def share(self) -> float:
        """Models done, of all."""
        return self.done / max(self.total, 1)

    def __str__(self) -> str:
        """Return it as a person would say it.

        >>> str(Standing(12, 28, ("gpi",), "cpi, CV RMSE 0.27 mm"))
        '12 of 28, fitting gpi; best so far cpi, CV RMSE 0.27 mm'
        """
        fitting = f", fitting {self.fitting[-1]}" if self.fitting else ""
        best = f"; best so far {self.best}" if self.best else ""
        return f"{self.done} of {self.total}{fitting}{best}"

"""Base classes of results with display on terminals, in notebooks, and in plots.

The report defines how each kind is shown. As the report imports these classes, it is looked up by name.
"""

from __future__ import annotations

from typing import Any, ClassVar

from mckibben.registry import load


class ShowsItself:
    """Prints as at most three lines of 80 columns, and displays as a small card in notebooks."""

    face: ClassVar[str]
    """Name of its kind, by which its card and its figures are found."""

    def __str__(self) -> str:
        found: str = load("faces", "card")(self).text()
        return found

    def _repr_html_(self) -> str:
        found: str = load("faces", "card")(self).html()
        return found


class DrawsItself(ShowsItself):
    """Also has the figures of the reports, by name."""

    def plot(self, kind: str | None = None, *, ax: Any = None, **choices: Any) -> Any:
        """Draw it with matplotlib.

        Parameters
        ----------
        kind : str, optional
            Which figure. Of a recording ``"loop"`` or ``"time"``; of a model ``"loop"``, its answer to a
            falling triangle, or against a ``recording`` ``"loops"``, ``"fit"`` or
            ``"residuals"``; of a leaderboard ``"errors"`` or, against a ``recording``, as a model; of a
            rig ``"loop"`` or ``"time"``; of a characterization ``"cycles"``; of a loop that was closed
            ``"time"``. Default: the first that can be drawn.
        ax : Axes or sequence of Axes, optional
            What to draw into, as many as the figure has panels; default a new figure of pyplot.
        **choices
            What the figure takes: channels as ``input`` and ``output``, a measured ``recording``.

        Returns
        -------
        Axes, or list of Axes of a figure of several panels

        Raises
        ------
        ModelError
            On an unknown kind, or where there is nothing to draw.
        DataError
            On absent channels, or another number of axes.
        """
        return load("faces", "plot")(self, kind, ax, choices)

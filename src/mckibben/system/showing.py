"""Base classes of what is displayed: on terminals, in notebooks, as tables and in plots.

The report defines how each kind is shown. As the report imports these classes, it is looked up by name.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

from mckibben.errors import ModelError, in_terms_of
from mckibben.hints import absent
from mckibben.registry import load
from mckibben.system.atomic import Numbers


@lru_cache
def _absence(owner: Any, name: str) -> str:
    """Return what the error says, once for all that only look whether there is such an attribute."""
    attributes = dict.fromkeys((*dir(owner), *owner.__dataclass_fields__))
    return absent(owner.__name__, name, attributes, getattr(owner, "face", ""))


class Hinted:
    """Names what there is instead of an attribute that it has not."""

    if not TYPE_CHECKING:  # a type checker still finds what is not there

        def __getattr__(self, name: str) -> Any:
            raise AttributeError(_absence(type(self), name), name=name, obj=self)


class DrawsItself:
    """Prints as at most three lines of 80 columns, displays as a card in notebooks, and has figures."""

    face: ClassVar[str]
    """Name of its kind, by which its card and its figures are found."""

    @property
    def drawn(self) -> Any:
        """What a plot of it draws: itself, unless it has something else for that."""
        return self

    def __str__(self) -> str:
        text: str = load("faces", "card")(self).text()
        return text

    def _repr_html_(self) -> str:
        html: str = load("faces", "card")(self).html()
        return html

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
            What the figure takes: channels as ``input`` and ``output``, a measured ``recording``;
            ``width=1`` or ``2`` columns of a journal, with its letters.

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


class Result(Hinted, DrawsItself, Numbers):
    """Result of an operation: prints as its command does, and has its numbers as a dict and a table."""

    def __str__(self) -> str:
        return in_terms_of("\n".join(load("faces", "lines")(self)))

    def __repr__(self) -> str:
        return str(self)

    def to_frame(self) -> Any:
        """Return its table as a data frame of pandas.

        Raises
        ------
        ModelError
            Where it has none.
        """
        raise ModelError(f"{type(self).__name__} has no table", remedy="use to_dict()")

"""Identified muscles, and priors derived from them."""

from mckibben.muscles.library import Muscle as Muscle
from mckibben.muscles.library import described as described
from mckibben.muscles.library import list as list  # noqa: A004
from mckibben.muscles.library import load as load
from mckibben.muscles.prior import Prior as Prior
from mckibben.muscles.prior import prior_of as prior_of
from mckibben.muscles.scaling import scaled as scaled
from mckibben.muscles.sheet import Sheet as Sheet


def show(name: str) -> str:
    """Return an identified muscle as the text of its file.

    >>> import mckibben
    >>> print(mckibben.muscles.show("mas20-hanging").splitlines()[0])
    format = "mckibben-muscle"
    """
    return described(load(name))

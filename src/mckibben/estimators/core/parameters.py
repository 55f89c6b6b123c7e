"""What scikit-learn wants to know of an estimator, told without importing it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self


@dataclass(kw_only=True, repr=False, eq=False)
class Parametrised:
    """Settings are the fields: to be read, changed, cloned and searched over by scikit-learn."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the settings by name; ``deep`` changes nothing, as none has settings of its own."""
        return {name: getattr(self, name) for name in self._names()}

    def set_params(self, **settings: Any) -> Self:
        """Change settings.

        Raises
        ------
        ValueError
            On a name that is none of them.
        """
        unknown = settings.keys() - set(self._names())
        if unknown:
            raise ValueError(
                f"{sorted(unknown)[0]!r} is no setting of {type(self).__name__}. "
                f"Remedy: choose among {', '.join(self._names())}."
            )
        for name, value in settings.items():
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        values = ((field.name, repr(getattr(self, field.name)), field) for field in fields(self))
        changed = [f"{name}={text}" for name, text, field in values if text != repr(field.default)]
        return f"{type(self).__name__}({', '.join(changed)})"

    def __sklearn_tags__(self) -> Any:
        from sklearn.base import BaseEstimator  # scikit-learn alone asks, so it is there already

        return BaseEstimator().__sklearn_tags__()

    @classmethod
    def _names(cls) -> list[str]:
        return sorted(field.name for field in fields(cls))

"""How leaderboards and studies are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mckibben.comparison.leaderboard import Leaderboard, Row
from mckibben.errors import ModelError
from mckibben.numerals import numeral
from mckibben.report import figures, model_subjects, words
from mckibben.report.drawing import Drawing
from mckibben.report.notebook.card import Card
from mckibben.report.notebook.face import Draw, Face
from mckibben.report.notebook.models import against

if TYPE_CHECKING:
    from mckibben.studying.study import Study


class LeaderboardFace(Face):
    """A leaderboard."""

    def __init__(self, board: Leaderboard) -> None:
        self.board = board

    def card(self) -> Card:
        """Return models in the order of the choice, with the test beside."""
        board = self.board
        heading, _ = words.CHOICES[board.chosen_by]
        unit = f" [{board.unit}]" if board.unit else ""
        ranked = [row for row in board.ranking if row.reason is None]
        failed = [row.model for row in board.rows if row.reason is not None]
        chosen = next((k for k, row in enumerate(ranked) if row is board.best), None)
        notes = [f"Split: {board.split}.", *filter(None, [words.chosen(board)])]
        notes += [f"Failed: {', '.join(failed)}."] if failed else []
        notes += [f"Pending: {', '.join(board.pending)}."] if board.pending else []
        if any(row.caution for row in board.rows if row.reason is None):
            notes.append(f"* {words.CAREFUL}")
        return Card(
            f"Leaderboard, {board.input} to {board.output}",
            headings=("rank", "model", f"{heading}{unit}", f"test RMSE{unit}", "inverse"),
            rows=[self._row(row) for row in ranked],
            marked=chosen,
            notes=notes,
        )

    def _row(self, row: Row) -> tuple[str, ...]:
        by_fit = row.train.rmse if row.train is not None else None
        chosen = by_fit if self.board.chosen_by == "fit" else row.validation_rmse
        inverse = "" if row.block is None else "yes" if row.inverse is not None else "none"
        return (
            numeral(row.test_rank),
            row.model + ("*" if row.caution else ""),
            numeral(chosen),
            numeral(None if row.test is None else row.test.rmse),
            inverse,
        )

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return the errors of all, or the models named on a recording, default the one chosen."""
        return {"errors": self.errors, **{k: self._on(k) for k in ("loops", "fit", "residuals")}}

    def errors(self) -> Drawing:
        """Draw the errors of all models."""
        return model_subjects.leaderboard(self.board)

    def drawing(self, kind: str | None, choices: Mapping[str, Any]) -> Drawing:
        """Return a figure of it; against a recording, if one is given."""
        return super().drawing(
            "loops" if kind is None and "recording" in choices else kind, choices
        )

    def _on(self, kind: str) -> Draw:
        def draw(models: str | Sequence[str] = (), **choices: Any) -> Drawing:
            if "recording" not in choices:
                raise ModelError(
                    f"{kind!r} draws models against a measurement", remedy="give it as recording="
                )
            asked = [models] if isinstance(models, str) else list(models)
            if not asked and self.board.best is not None:
                asked = [self.board.best.model]
            blocks = {row.model: row.block for row in self.board.rows if row.block is not None}
            found = {name: block for name in asked if (block := blocks.get(name)) is not None}
            if not found or len(found) < len(asked):
                raise ModelError(
                    f"there is no model {', '.join(asked) or 'chosen'} to draw",
                    remedy="name some of "
                    f"{', '.join(blocks) or 'a leaderboard where a model worked'} as "
                    "models=",
                )
            return against(found)[kind](**choices)

        return draw


class StudyFace(Face):
    """A study."""

    def __init__(self, study: Study) -> None:
        self.study = study

    def card(self) -> Card:
        """Return what the muscle does, and the leaderboard."""
        study = self.study
        board = LeaderboardFace(study.leaderboard).card()
        known = study.characterization
        notes = list(board.notes)
        if study.inverse is not None:
            notes.append(f"Inverted: {study.inverse.model}.")
        return Card(
            f"Study, {study.input} to {study.output}",
            () if known is None else words.characterization_sentences(known),
            board.headings,
            board.rows,
            board.marked,
            notes,
        )

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return the figures of its report; the loop with the model first."""
        order = dict.fromkeys(["loops", *figures.FIGURES])
        return {name: lambda name=name: figures.FIGURES[name](self.study) for name in order}

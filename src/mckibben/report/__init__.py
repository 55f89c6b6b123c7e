"""Reports of studies: one offline HTML page, and figures for print.

Every figure is described once, free of any drawing library (`subjects`, `model_subjects`), and drawn
twice: for the page (`interactive`) and for print (`printed`).
"""

from mckibben import hints
from mckibben.report.page import write_report
from mckibben.report.results_folder import StudyFolder, write_leaderboard

__all__ = ["StudyFolder", "write_leaderboard", "write_report"]

hints.lead_on(__name__)

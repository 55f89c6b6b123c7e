"""What a study found, for people: one offline HTML page, and figures for print.

Every figure is described once, free of any drawing library (`subjects`, `model_subjects`), and drawn
twice: for the page (`interactive`) and for print (`printed`).
"""

from mckibben.report.page import write_report

__all__ = ["write_report"]

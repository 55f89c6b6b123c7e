"""Operations of users: the same from Python, the command line and the workbench.

Each takes data and returns a result, which prints as the command does and has its numbers as
``to_dict()``. Parameters that they have in common:

data
    A path, a data frame, arrays by name (``{"pressure": u, "displacement": y}``, with ``sample_time`` or
    ``rate``), a recording, or a list of these. A folder includes all recordings in it.
model : Block, result of `fit` or `invert`, or file
options : dataclass, optional
    Of `mckibben.options`; its fields may also be given by name, as may those of ``reading``. A text is
    understood as on the command line.
reading : ReadOptions, optional
    How data are read.
out : path, optional
    File or folder to write. The files of an earlier run are replaced when all is done.
force : bool
    Whether files of the user's may be replaced, too; what is read never is.
progress : bool or callable, optional
    Whether to show a bar; or called with the share done and words.

They raise `DataError` on recordings, and `ModelError` on models or options, that cannot be used.
"""

from mckibben.workflow.compensating import export, invert, learn, track
from mckibben.workflow.examining import (
    calibrate,
    characterize,
    check,
    data_gaps,
    info,
    plan,
    plot,
    reproduce,
    review,
    simulate,
)
from mckibben.workflow.identifying import compare, estimator, fit, models, study
from mckibben.workflow.operation import OPERATIONS, Operation, load_model

__all__ = [
    "OPERATIONS",
    "Operation",
    "calibrate",
    "characterize",
    "check",
    "compare",
    "data_gaps",
    "estimator",
    "export",
    "fit",
    "info",
    "invert",
    "learn",
    "load_model",
    "models",
    "plan",
    "plot",
    "reproduce",
    "review",
    "simulate",
    "study",
    "track",
]

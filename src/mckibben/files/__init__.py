"""Recordings from and to files: the only place where units are converted."""

from mckibben.files.reading import columns_of as columns_of
from mckibben.files.reading import read as read
from mckibben.files.writing import write as write

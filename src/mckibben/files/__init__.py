"""Reading and writing of recordings; units are converted only here."""

from mckibben.files.own import write as write
from mckibben.files.reading import columns_of as columns_of
from mckibben.files.reading import read as read

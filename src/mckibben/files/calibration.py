"""From the columns of a file to channels, by what the folder says of them: units, gains, constants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mckibben.files.channels import Channel, Described
from mckibben.files.headers import unit_of
from mckibben.files.table import Column, Table
from mckibben.files.units import weight


def constants(described: Described, table: Table) -> dict[str, Column]:
    """Return columns for the channels that are constants, by channel; the header is the channel's.

    Of a force, a mass is the weight that hangs there: nobody measured it.
    """
    n, found = table.n_samples, {}
    for name, given in described.channels.items():
        if given.value is not None:
            unit = given.unit
            if unit is not None and unit_of(name) == "N":
                unit = weight(unit)
            found[name] = Column(name, np.full(n, given.value), unit)
    return found


def calibrated(
    named: Mapping[str, Column],
    described: Described,
    asked: Mapping[str, tuple[float, float]],
) -> tuple[dict[str, Column], dict[str, Any]]:
    """Return columns in the units that are said, gain times themselves plus offset; and which were.

    Gain and offset that are asked for go before those described. A column of text stays one, to be
    refused as such.
    """
    columns: dict[str, Column] = {}
    told: dict[str, Any] = {}
    for name, column in named.items():
        given = described.time if name == "time" else described.channels.get(name)
        held = isinstance(given, Channel) and given.value is not None and column.header == name
        if given is not None and given.unit is not None and not held:
            column = replace(column, unit=given.unit)
        known = isinstance(given, Channel) and given.is_calibrated
        if (name in asked or known) and column.values is not None:
            if name in asked:
                gain, offset = asked[name]
            else:
                assert isinstance(given, Channel)
                gain, offset = 1.0 if given.gain is None else given.gain, given.offset or 0.0
            with np.errstate(over="ignore"):
                values = gain * column.values + offset
            column = replace(column, values=values)
            told[name] = {"column": column.header, "gain": gain, "offset": offset}
        elif held and isinstance(given, Channel):
            told[name] = {"value": given.value, "unit": given.unit}
        columns[name] = column
    return columns, told

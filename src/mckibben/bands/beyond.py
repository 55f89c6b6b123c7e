"""What of a run lies beyond what calibration saw: there a band is a guess."""

from __future__ import annotations

from mckibben.arrays import Array
from mckibben.blocks.bands import WIDENS, Band
from mckibben.numerals import numeral


def beyond_calibrated(band: Band, samples: Array, name: str) -> list[str]:
    """Return, a sentence a channel, what lies beyond what calibration saw.

    Parameters
    ----------
    band : Band
    samples : array, shape (n, inputs and outputs)
        The model's inputs, then its outputs.
    name : str
        Of the run.
    """
    notes = []
    for channel, values, low, high in zip(band.inputs, samples.T, *band.ends, strict=True):
        reach = WIDENS * (high - low)
        share = float(((values < low - reach) | (values > high + reach)).mean())
        if share > 0:
            ends = " to ".join(numeral(float(end), 3) for end in (values.min(), values.max()))
            known = f"{numeral(low, 3)} to {numeral(high, 3)} {channel.unit}".strip()
            notes.append(
                f"in {name}, {channel.name} goes from {ends}, and calibration saw {known}: on "
                f"{numeral(100 * share, 2)} % of the samples the band is wider by a guess. Remedy: "
                "calibrate on recordings that go there too"
            )
    return notes

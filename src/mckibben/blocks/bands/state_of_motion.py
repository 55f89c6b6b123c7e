"""What a band looks at: where the inputs are, since their last reversal, and how fast they got there.

Every input, scaled to the range that calibration saw, gives its level, how far it is from its last
reversals (plays of several widths, over their widths: 1 where the play is drawn along, less where the
input just turned), and how far it is from its own past (lags of several times). Every modelled output
gives its level. All is known at the sample itself, so that a stream knows it, too.
"""

from __future__ import annotations

from mckibben.arrays import Array
from mckibben.blocks.kernels import kernel


@kernel
def look(
    x: Array,
    ends: Array,
    widths: Array,
    keeps: Array,
    n_driving: int,
    state: Array,
    seen: Array,
) -> float:
    """Take one sample, shape (n_x,), fill ``seen`` and return how far it is beyond what was seen.

    Parameters
    ----------
    x : array
        Inputs, of which there are ``n_driving``, then modelled outputs.
    ends : array, shape (2 n_x,)
        Lowest of each, then highest.
    widths, keeps : array
        Of plays, as shares of the range; and what lags keep of themselves from sample to sample.
    state : array, shape (n_driving (widths + keeps),)
        Plays and lags of the first input, then of the next, in shares of its range.
    seen : array, shape (n_x + n_driving (widths + keeps),)
        What is found.

    Returns
    -------
    float
        The largest distance beyond an end, in shares of that channel's range.
    """
    beyond, place, slot = 0.0, 0, 0
    for j in range(x.size):
        low, high = ends[j], ends[x.size + j]
        share = (x[j] - low) / (high - low)
        beyond = max(beyond, share - 1.0, -share)
        share = min(max(share, 0.0), 1.0)
        seen[place] = share
        place += 1
        if j >= n_driving:
            continue
        for i in range(widths.size):
            at = min(max(state[slot], share - widths[i]), share + widths[i])
            state[slot] = at
            seen[place] = (share - at) / widths[i]
            slot += 1
            place += 1
        for i in range(keeps.size):
            at = share + keeps[i] * (state[slot] - share)
            state[slot] = at
            seen[place] = share - at
            slot += 1
            place += 1
    return beyond


@kernel
def look_along(
    samples: Array, ends: Array, widths: Array, keeps: Array, n_driving: int, found: Array
) -> None:
    """Fill ``found``, shape (n, what is seen), over a run that begins at rest."""
    per = widths.size + keeps.size
    state = samples[0, :1].repeat(n_driving * per)
    for j in range(n_driving):
        low, high = ends[j], ends[samples.shape[1] + j]
        first = min(max((samples[0, j] - low) / (high - low), 0.0), 1.0)
        state[j * per : (j + 1) * per] = first
    for t in range(samples.shape[0]):
        look(samples[t], ends, widths, keeps, n_driving, state, found[t])

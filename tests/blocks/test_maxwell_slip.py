"""Springs side by side, against springs one at a time."""

from __future__ import annotations

import numpy as np

from mckibben.blocks.play_type.maxwell_slip import slip_matrix


def test_springs_side_by_side_agree_with_each_alone() -> None:
    rng = np.random.default_rng(0)
    u, limits = rng.uniform(0.0, 5.0, 300), np.array([0.2, 0.9, 2.0])
    stiffness, ratio = 1.3, 0.7
    deflections = np.empty((u.size, limits.size))
    slip_matrix(u, limits, stiffness, ratio, limits.copy(), deflections)
    for limit, found in zip(limits.tolist(), deflections.T, strict=True):
        s, expected = limit, [limit]
        for move in np.diff(u).tolist():
            s = min(s + move, limit) if move >= 0 else max(s + stiffness * move, -ratio * limit)
            expected.append(s)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)

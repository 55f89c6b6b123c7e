"""What the paper prints: its Tables 2, 4 and 5."""

from __future__ import annotations

ORDERS = {5: 2.65, 10: 1.36, 15: 1.52, 20: 1.63}
"""Err by the order of the first muscle's GPI as printed, Table 2 [%]."""

PREDICTION: dict[str, tuple[float, float, float, float]] = {
    "a": (1.74, 1.17, 16.45, 11.27),
    "b": (1.03, 0.45, 10.59, 5.49),
    "c": (1.02, 0.40, 13.21, 7.20),
    "d": (1.02, 0.43, 10.35, 4.80),
    "e": (1.70, 1.13, 17.37, 12.98),
    "f": (1.02, 0.40, 7.83, 2.60),
    "g": (0.98, 0.37, 6.32, 2.24),
    "h": (0.96, 0.32, 6.53, 2.69),
    "i": (1.71, 1.15, 10.26, 4.84),
    "j": (2.88, 2.14, 10.10, 4.01),
    "k": (1.53, 1.03, 16.12, 10.99),
    "l": (1.55, 1.04, 18.11, 13.64),
}
"""Err [%] and RMSE [mm] of SDCHM, then of the raw network, as printed, Table 4."""

TRACKING: dict[str, tuple[float, float, float, float, float, float]] = {
    "a": (0.58, 0.21, 6.12, 2.31, 2.89, 3.01),
    "b": (0.87, 1.09, 7.13, 7.55, 3.51, 4.33),
    "c": (1.02, 1.21, 6.78, 8.53, 4.03, 4.96),
    "d": (0.83, 1.06, 7.02, 9.12, 3.92, 4.01),
    "e": (0.62, 0.34, 3.58, 3.55, 1.75, 3.36),
    "f": (0.75, 1.02, 6.88, 11.10, 3.42, 3.89),
    "g": (1.86, 1.33, 10.23, 13.86, 6.21, 5.87),
    "h": (2.33, 1.56, 8.89, 10.21, 3.89, 5.12),
    "i": (0.61, 0.29, 1.89, 2.03, 2.05, 1.96),
}
"""e_w [%] and RMSE [mm] of SDIHC, the individual inverse and PID as printed, Table 5."""

TASK = (-1.33, 1.25)
"""Lowest and highest steady error of SDIHC as printed, Section 5.2 [mm]."""

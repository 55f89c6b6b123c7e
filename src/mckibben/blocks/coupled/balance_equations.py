"""The balance of forces on paper: only the terms that a model has."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mckibben.blocks.coupled.balance import Balance


def balance_of_forces(balance: Balance) -> tuple[str, ...]:
    """Return the equations of a balance, without what it lacks, in LaTeX."""
    springs = r"S_{k0} + \sum_j S_{kj} y_j"
    if len(balance.scheduled) > balance.n_loads:
        springs = r"\sum_q x^q \left(S_{kq0} + \sum_j S_{kqj} y_j\right)"
    terms = {
        r"\sum_l C_{kl} F_l": any(map(any, balance.loads)),
        springs: True,
        "E_k(y_k)": True,
        r"\sum_m h_{km} s_{km}": any(map(any, balance.friction)),
        r"\sum_l \kappa_{kl} q_{kl}": any(map(any, balance.relaxation)),
        r"d_k \dot{y}_k": any(balance.damping),
        r"l_k \left(\frac{A_k}{a_{k0}}\right)^2 \dot{y}_k": any(balance.lines),
        r"m_k \ddot{y}_k": any(balance.mass),
    }
    memory = {
        r"s_{km} \text{ follows } y_k + w_k p_k \text{ up to } \pm r_m (p_k + p_0)": balance.limits,
        r"\dot{q}_{kl} = \dot{y}_k - q_{kl} / \tau_l": balance.lags,
    }
    remembered = r",\quad ".join(line for line, numbers in memory.items() if numbers)
    forces = " + ".join(term for term, there in terms.items() if there)
    lines = (f"p_k A_k(y_k) = {forces}", *balance.notation.equations, remembered)
    return tuple(line for line in lines if line)

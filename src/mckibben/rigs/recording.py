"""Recording a whole protocol on a rig."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from mckibben.recording import Recording
from mckibben.rigs.rig import Rig, load_rig
from mckibben.signals import cut
from mckibben.signals.checking import generator
from mckibben.signals.protocol import PlannedRun, Protocol, protocol
from mckibben.system.threads import cores


def share(rig: Rig | None, channel: str, printed: float) -> float:
    """Return the highest command of a rig relative to that of a paper's rig; 1 without a rig."""
    return 1.0 if rig is None else rig.limits(channel).high / printed


def record(
    what: Protocol | str,
    rig: Rig | None = None,
    *,
    runs: Sequence[str] | None = None,
    seed: int = 0,
    jobs: int | None = None,
) -> Iterator[tuple[PlannedRun, Recording]]:
    """Record a protocol, run by run, in its order.

    Parameters
    ----------
    what : Protocol or str
        The protocol, or its name.
    rig : Rig, optional
        Default the rig that the protocol was made for.
    runs : sequence of str, optional
        Names of the runs wanted; default all.
    seed : int
        Of the sensor noise; every run has its own, which does not depend on the others asked for.
    jobs : int, optional
        Runs at a time; default as many as there are cores.

    Yields
    ------
    run, recording
        As soon as each is done; the recording's ``meta`` has the run's name, role and labels.

    Raises
    ------
    DataError
        On an unknown run, or a rig that lacks the protocol's channels or parameters.
    """
    plan = protocol(what, rig) if isinstance(what, str) else what
    plant = load_rig(plan.rig) if rig is None else rig
    planned = plan.runs if runs is None else tuple(plan[name] for name in runs)
    generator(seed)  # refuses what is none
    places = {run.name: index for index, run in enumerate(plan.runs)}

    def recorded(run: PlannedRun) -> Recording:
        own_seed = int(np.random.SeedSequence((seed, places[run.name])).generate_state(1)[0])
        measured = plant.changed(run.settings).run(run.inputs, own_seed)
        if run.lead:
            measured = replace(cut(measured, run.lead), start_time=0.0)
        return measured.with_meta(
            name=run.name, protocol=plan.name, role=run.role, labels=dict(run.labels)
        )

    n_threads = cores() if jobs is None else jobs
    with ThreadPoolExecutor(max_workers=n_threads) as pool:
        pending = [pool.submit(recorded, run) for run in planned]
        try:
            for run, result in zip(planned, pending, strict=True):
                yield run, result.result()
        finally:
            for result in pending:
                result.cancel()

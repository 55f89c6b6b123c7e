"""Learn to follow a random reference with a joint between two muscles, and compare with PID.

    pip install 'mckibben[mujoco,gym]'
    python examples/learn_joint.py joint.xml

The model is of ``mckibben export mjcf model.json --example joint --lag 0.05 -o joint.xml``. Both
controllers set the difference of the two pressures from a weighted sum; the weights are found by the
cross-entropy method on the same episodes. PID sums the error, its integral and the velocity; the policy
also the reference ahead and the last action. What counts is the error on references not used to learn.
"""

import sys
import time

import numpy as np

from joint_environment import JointTracking

COPIES, ROUNDS, ELITE = 128, 30, 16
"""Candidates of a round, rounds, and how many of the best set the next round's distribution."""

PREVIEW = 8
"""Control steps ahead that the policy sees."""

FIRST = 0.5
"""Of an episode, that is not counted: it starts without pressure [s]."""


def features(seen: np.ndarray, integral: np.ndarray, pid: bool) -> np.ndarray:
    """Return what a controller sums, shape (copies, features), from observations."""
    angle, speed, reference = seen[:, 0], seen[:, 1], seen[:, 2]
    common = (reference - angle, integral, -10.0 * speed)
    if pid:
        return np.stack(common, axis=1)
    ahead = seen[:, 3 : 3 + PREVIEW] - reference[:, np.newaxis]
    difference = 0.5 * (seen[:, -1] - seen[:, -2])
    return np.column_stack([*common, ahead, reference, difference])


def errors(env: JointTracking, weights: np.ndarray, seed: int, pid: bool) -> np.ndarray:
    """Return the mean absolute error of every copy over an episode, of half the range."""
    seen, _ = env.reset(seed=seed)
    integral, total, counted = np.zeros(env.num_envs), np.zeros(env.num_envs), 0
    over = False
    while not over:
        integral = integral + (seen[:, 2] - seen[:, 0]) * env.control_time
        each = (features(seen, integral, pid) * weights[:, 1:]).sum(axis=1)
        action = np.stack([weights[:, 0] - each, weights[:, 0] + each], axis=1)
        seen, reward, _, truncated, _ = env.step(action.astype(np.float32))
        over = bool(truncated.all())
        counted += 1
        if counted * env.control_time > FIRST:
            total -= reward
    return total / (counted - FIRST / env.control_time)


def learned(env: JointTracking, pid: bool) -> np.ndarray:
    """Return weights found by the cross-entropy method."""
    random = np.random.default_rng(0)
    size = 1 + (3 if pid else 3 + PREVIEW + 2)
    mean, spread = np.zeros(size), np.full(size, 1.0)
    mean[1:4], spread[1:4] = (1.0, 20.0, 1.0), (1.0, 10.0, 1.0)
    for turn in range(ROUNDS):
        weights = mean + spread * random.standard_normal((COPIES, size))
        found = errors(env, weights, seed=1000 + turn, pid=pid)
        best = weights[np.argsort(found)[:ELITE]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.3 * 0.9**turn
        print(f"\r{'PID' if pid else 'policy'}: round {turn + 1} of {ROUNDS}", end="", flush=True)
    print()
    return mean


def main() -> None:
    env = JointTracking(sys.argv[1], COPIES, preview=PREVIEW, duration=5.0)
    begun = time.monotonic()
    for pid in (True, False):
        weights = np.tile(learned(env, pid), (COPIES, 1))
        found = errors(env, weights, seed=1, pid=pid)  # references that learning did not see
        print(
            f"{'PID' if pid else 'policy'}: mean error {100 * found.mean():.2f} % of half the range, "
            f"worst of {COPIES} {100 * found.max():.2f} % ({time.monotonic() - begun:.0f} s)"
        )


if __name__ == "__main__":
    main()

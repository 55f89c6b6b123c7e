"""Learn to follow a random reference with a joint between two muscles, and compare with PID.

    pip install 'mckibben[mujoco,gym]'
    python examples/learn_joint.py joint.xml

Create the model with ``mckibben export mjcf model.json --example joint --lag 0.05 -o joint.xml``.
The output of both controllers is the difference of the two pressures, a weighted sum of features.
The weights are optimized by the cross-entropy method on the same episodes. The features of PID are
the error, its integral and the velocity; those of the policy also include the previewed reference
and the last action. The printed error is that on new references.
"""

import sys
import time

import numpy as np

from joint_environment import JointTracking

COPIES, ROUNDS, ELITE = 128, 30, 16
"""Candidates per round, rounds, and best candidates that define the next distribution."""

PREVIEW = 8
"""Preview of the policy in control steps."""

FIRST = 0.5
"""Initial part of an episode that is not counted, as it starts without pressure [s]."""


def features(seen: np.ndarray, integral: np.ndarray, pid: bool) -> np.ndarray:
    """Return the features of a controller from observations, shape (copies, features)."""
    angle, speed, reference = seen[:, 0], seen[:, 1], seen[:, 2]
    common = (reference - angle, integral, -10.0 * speed)
    if pid:
        return np.stack(common, axis=1)
    ahead = seen[:, 3 : 3 + PREVIEW] - reference[:, np.newaxis]
    difference = 0.5 * (seen[:, -1] - seen[:, -2])
    return np.column_stack([*common, ahead, reference, difference])


def errors(env: JointTracking, weights: np.ndarray, seed: int, pid: bool) -> np.ndarray:
    """Return the mean absolute error of every copy over an episode, relative to half the range."""
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
        found = errors(env, weights, seed=1, pid=pid)  # new references
        print(
            f"{'PID' if pid else 'policy'}: mean error {100 * found.mean():.2f} % of half the range, "
            f"worst of {COPIES} {100 * found.max():.2f} % ({time.monotonic() - begun:.0f} s)"
        )


if __name__ == "__main__":
    main()

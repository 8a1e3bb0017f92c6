# /// script
# dependencies = ["gaitchain[sim,rl]"]
# ///
"""Train residuals on the walk for a minute on the CPU, and see whether they help.

1. The policy adds W [1, sin, cos of the phase] to the joint targets: 36 numbers.
2. An evolution strategy changes W, each pair of walks with the same seed (antithetic).
3. What came of it is compared with no residuals on seeds that training has not seen.
"""

import sys
import time

import gymnasium
import numpy as np

from gaitchain.rl.registration import WALK

TRAINED_S = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
PAIRS, SPREAD, RATE, PERIODS = 4, 0.05, 0.05, 300

env = gymnasium.make(WALK, max_episode_steps=PERIODS, residual_rad=0.1)
phase = env.unwrapped.layout.phase


def walk(weights, seed):
    """Return the sum of rewards of one walk, with its own command and world."""
    seen, _ = env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        action = weights @ np.append(1.0, seen[phase])
        seen, reward, fell, late, _ = env.step(action.astype(np.float32))
        total, over = total + reward, fell or late
    return total


rng, weights = np.random.default_rng(0), np.zeros((env.action_space.shape[0], 3))
start, walks = time.monotonic(), 0
while time.monotonic() - start < TRAINED_S:
    step = np.zeros_like(weights)
    for _ in range(PAIRS):
        noise, seed = rng.standard_normal(weights.shape), int(rng.integers(1000, 2**31))
        better = walk(weights + SPREAD * noise, seed)
        worse = walk(weights - SPREAD * noise, seed)
        step += np.sign(better - worse) * noise / PAIRS
        walks += 2
    weights += RATE * step / np.sqrt(weights.size)
print(f"trained on {walks} walks of {PERIODS / 100:g} s")

held_out = range(20 if TRAINED_S >= 60.0 else 3)
before = np.array([walk(np.zeros_like(weights), seed) for seed in held_out])
gain = np.array([walk(weights, seed) for seed in held_out]) - before
error = gain.std(ddof=1) / np.sqrt(len(gain))
print(f"reward without residuals {before.mean():.1f}")
print(f"with them {gain.mean():+.1f}, standard error {error:.1f}, {len(gain)} seeds")
known = abs(gain.mean()) > 2.0 * error
print(("better" if gain.mean() > 0.0 else "worse") if known else "no clear difference")

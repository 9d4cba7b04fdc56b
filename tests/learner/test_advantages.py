"""Generalised advantage estimation, by hand and against its definition."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taskschema_learner.update.advantages import generalised_advantages


def test_hand_computed() -> None:
    rewards = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    values = np.array([[0.5, 0.4, 9.0], [0.2, 0.1, 0.3]])
    result = generalised_advantages(rewards, values, np.array([2, 3]), gamma=0.9, gae_lambda=0.5)
    # first episode, a success at its second step; what stands behind it (9.0) is not read:
    #   delta_1 = 1 - 0.4 = 0.6                      A_1 = 0.6
    #   delta_0 = 0.9 * 0.4 - 0.5 = -0.14            A_0 = -0.14 + 0.45 * 0.6 = 0.13
    np.testing.assert_allclose(result[0], [0.13, 0.6, 0.0], atol=1e-12)
    # second episode, a failure of three steps, nothing bootstrapped behind its end:
    #   delta_2 = -0.3                               A_2 = -0.3
    #   delta_1 = 0.9 * 0.3 - 0.1 = 0.17             A_1 = 0.17 - 0.45 * 0.3 = 0.035
    #   delta_0 = 0.9 * 0.1 - 0.2 = -0.11            A_0 = -0.11 + 0.45 * 0.035 = -0.09425
    np.testing.assert_allclose(result[1], [-0.09425, 0.035, -0.3], atol=1e-12)


@given(
    length=st.integers(1, 4),
    numbers=st.lists(st.floats(-2, 2), min_size=8, max_size=8),
    gamma=st.floats(0, 1),
    gae_lambda=st.floats(0, 1),
)
def test_equals_the_weighted_sum_of_n_step_advantages(
    length: int, numbers: list[float], gamma: float, gae_lambda: float
) -> None:
    rewards, values = np.array(numbers[:4]), np.array(numbers[4:])
    inside = np.arange(4) < length
    rewards = np.where(inside, rewards, 0.0)
    result = generalised_advantages(rewards[None], values[None], np.array([length]), gamma, gae_lambda)[0]
    ended = np.append(np.where(inside, values, 0.0), 0.0)
    deltas = rewards + gamma * ended[1:] - ended[:-1]
    for step in range(4):
        wanted = (
            sum((gamma * gae_lambda) ** k * deltas[step + k] for k in range(length - step))
            if step < length
            else 0
        )
        np.testing.assert_allclose(result[step], wanted, atol=1e-9)


def test_lambda_one_gives_whole_returns() -> None:
    rewards = np.array([[0.0, 0.0, 1.0]])
    values = np.array([[0.3, 0.2, 0.1]])
    result = generalised_advantages(rewards, values, np.array([3]), gamma=0.9, gae_lambda=1.0)
    np.testing.assert_allclose(result + values, [[0.81, 0.9, 1.0]])

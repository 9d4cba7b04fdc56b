"""The gymnasium environments, over every registered task."""

import os
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv

import taskschema_worker
from taskschema.errors import UnknownNameError
from taskschema.tasks.registry import get_task, task_names


def environment_id(task):
    return f"taskschema/{''.join(word.capitalize() for word in task.split('-'))}-v0"


def expert_action(environment, observation, step):
    task = environment.unwrapped.task
    pair = task.paper_pairs[min(step, len(task.paper_pairs) - 1)]
    arguments = task.pairs.to_normalised(task.expert_arguments(observation[None], step))[0]
    return {"pair": int(pair), "arguments": arguments.astype(np.float32)}


@pytest.fixture(params=task_names())
def environment(request):
    made = gymnasium.make(environment_id(request.param), obs_type="state")
    yield made
    made.close()


def test_gymnasium_s_checker_accepts_every_task(environment):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Observations in SI units have no bounds that hold for every task.
        warnings.filterwarnings(
            "ignore", message=".*Box observation space (min|max)imum value is.*infinity.*"
        )
        check_env(environment.unwrapped, skip_render_check=True)


def test_stable_baselines_checker_accepts_all_but_the_dict_action(environment):
    from gymnasium import spaces
    from stable_baselines3.common.env_checker import check_env as check_with_stable_baselines

    class PairFirst(gymnasium.ActionWrapper):
        """The same actions as one box, the form that Stable Baselines has."""

        def __init__(self, wrapped):
            super().__init__(wrapped)
            size = wrapped.action_space["arguments"].shape[0]
            self.action_space = spaces.Box(-1, 1, (1 + size,), np.float32)

        def action(self, action):
            count = len(self.unwrapped.pairs)
            pair = min(int((action[0] + 1) / 2 * count), count - 1)
            return {"pair": pair, "arguments": action[1:]}

    with pytest.warns(UserWarning, match="action space"):  # Stable Baselines' learners take no Dict
        check_with_stable_baselines(environment.unwrapped, skip_render_check=True)
    check_with_stable_baselines(PairFirst(environment), skip_render_check=True)


def test_names_say_what_an_action_is(environment):
    unwrapped = environment.unwrapped
    task = unwrapped.task
    assert environment.action_space["pair"].n == len(unwrapped.pairs) == len(task.pairs)
    assert environment.action_space["arguments"].shape == (len(unwrapped.argument_names),)
    assert unwrapped.pairs[0] == (task.pairs.skills[0].name, task.pairs.skills[0].name)
    assert all(name.startswith(("left.", "right.")) for name in unwrapped.argument_names)
    assert all(name.endswith((" [m]", " [rad]")) for name in unwrapped.argument_names)


def test_the_expert_succeeds_with_reward_one_and_terminates(environment):
    outcomes = []
    for seed in range(3):
        observation, _ = environment.reset(seed=seed)
        for step in range(len(environment.unwrapped.task.paper_pairs)):
            observation, reward, terminated, truncated, info = environment.step(
                expert_action(environment, observation, step)
            )
            assert not truncated
            if terminated:
                break
        outcomes.append((reward, terminated, info["is_success"]))
    assert outcomes.count((1.0, True, True)) >= 2  # the expert may miss one instance in twenty


def test_an_episode_without_success_terminates_at_the_horizon(environment):
    unwrapped = environment.unwrapped
    environment.reset(seed=0)
    nothing = {
        "pair": unwrapped.pairs.index(("no_op", "no_op")),
        "arguments": np.zeros(len(unwrapped.argument_names), dtype=np.float32),
    }
    ends = [environment.step(nothing)[1:5] for _ in range(unwrapped.task.horizon)]
    assert [terminated for _, terminated, _, _ in ends] == [False] * (len(ends) - 1) + [True]
    assert all(reward == 0.0 and not info["is_success"] for reward, _, _, info in ends)


def test_the_same_seed_gives_the_same_episode(environment):
    first, _ = environment.reset(seed=7)
    again, _ = environment.reset(seed=7)
    other, _ = environment.reset(seed=8)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


NOTHING = object()


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("pair", 99, "no skill pair 99. Valid: 0: reach, reach; 1: reach, raise; 2: reach, no_op; 3: raise"),
        ("pair", -1, "no skill pair -1"),
        ("pair", 1.5, "one integer"),
        ("pair", [1], "one integer; got shape \\(1,\\)"),
        ("pair", "reach", "one integer"),
        ("pair", NOTHING, "see action_space"),
        ("arguments", [0.0, 0.0, np.nan, 0.0, 0.0, 0.0], r"left.raise.distance is nan"),
        ("arguments", [0.0, 0.0, 0.0, 0.0, -np.inf, 0.0], r"right.reach.y is -inf"),
        ("arguments", [0.0] * 5, "shape \\(6,\\)"),
        ("arguments", ["0.0"] * 6, "of numbers"),
        ("arguments", [[0.0], [0.0, 0.0]], "see action_space"),
        ("arguments", NOTHING, "see action_space"),
    ],
)
def test_a_bad_action_is_refused_by_name(name, value, reason):
    single, several = gymnasium.make("taskschema/Toy-v0"), gymnasium.make_vec("taskschema/Toy-v0", num_envs=2)
    single.reset(seed=0)
    several.reset(seed=0)
    good = {"pair": 0, "arguments": np.zeros(6, dtype=np.float32)}
    bad = {key: item for key, item in {**good, name: value}.items() if item is not NOTHING}
    with pytest.raises(InvalidAction, match=reason) as refusal:
        single.unwrapped.step(bad)
    assert "\n" not in str(refusal.value)
    with pytest.raises(InvalidAction):
        several.step({key: [good[key], item] for key, item in bad.items()})
    observations = several.step({key: np.stack([item, item]) for key, item in good.items()})[0]
    np.testing.assert_array_equal(observations[0], single.step(good)[0])


def test_actions_that_a_reset_ignores_are_not_looked_at():
    vector = gymnasium.make_vec("taskschema/Toy-v0", num_envs=2)
    vector.reset(seed=0)
    idle = {"pair": np.array([8, 8]), "arguments": np.zeros((2, 6), dtype=np.float32)}
    for _ in range(get_task("toy").horizon):
        ended = vector.step(idle)[2]
    assert ended.all()
    vector.step({"pair": np.array([99, 99]), "arguments": np.full((2, 6), np.nan)})
    with pytest.raises(InvalidAction, match="left.reach.x is nan"):
        vector.step({"pair": np.array([8, 8]), "arguments": np.full((2, 6), np.nan)})


def test_an_unknown_kind_of_observation_is_refused():
    with pytest.raises(UnknownNameError, match="obs_type"):
        gymnasium.make("taskschema/Toy-v0", obs_type="sound")


def test_the_vector_environment_equals_single_ones_step_by_step():
    task = get_task("toy")
    count, rng = 7, np.random.default_rng(0)
    together = gymnasium.make_vec("taskschema/Toy-v0", num_envs=count)
    apart = SyncVectorEnv([lambda: gymnasium.make("taskschema/Toy-v0") for _ in range(count)])
    observations, _ = together.reset(seed=3)
    np.testing.assert_array_equal(observations, apart.reset(seed=3)[0])
    successes = 0
    for _ in range(60):
        # The expert's arguments under random pairs: episodes end at different steps, in every mixture.
        arguments = task.pairs.to_normalised(task.expert_arguments(observations, 0)).astype(np.float32)
        reach, lift = task.paper_pairs
        pairs = rng.choice([reach, lift, lift, 8], size=count)
        actions = {"pair": pairs, "arguments": arguments}
        observations, rewards, ended, truncated, infos = together.step(actions)
        expected = apart.step(actions)
        for given, wanted in zip((observations, rewards, ended, truncated), expected[:4], strict=True):
            np.testing.assert_array_equal(given, wanted)
        np.testing.assert_array_equal(infos["is_success"], rewards == 1)
        successes += int(rewards.sum())
    assert successes > 5
    together.close()
    apart.close()


def test_the_vector_environment_makes_at_most_one_batch_per_step_of_an_episode(monkeypatch):
    from taskschema_worker import gymnasium_vector

    made = []

    def counted(task, threads=1, observation="state"):
        made.append(task.make_environment(threads))
        return made[-1]

    monkeypatch.setattr(gymnasium_vector, "build_environment", counted)
    vector = gymnasium.make_vec("taskschema/Toy-v0", num_envs=16)
    vector.reset(seed=0)
    vector.action_space.seed(0)
    for _ in range(40):
        vector.step(vector.action_space.sample())
    assert len(made) <= get_task("toy").horizon + 1


def test_importing_the_package_imports_no_simulator_and_no_ray():
    code = (
        "import sys, taskschema_worker;"
        "print([name for name in ('mujoco', 'robosuite', 'ray', 'torch') if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
    assert result.stderr == ""


def test_a_rollout_actor_does_not_even_import_gymnasium():
    code = "import sys, taskschema_worker.worker; print('gymnasium' in sys.modules)"
    environment = {**os.environ, taskschema_worker.WITHOUT_GYMNASIUM: "1"}
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert result.stdout.strip() == "False"

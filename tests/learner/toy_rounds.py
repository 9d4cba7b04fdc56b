"""Rounds of the toy task in this process, for tests of learning."""

from taskschema.config import RunConfig
from taskschema.policies import Policy
from taskschema.tasks import get_task
from taskschema.trajectory import Trajectory
from taskschema_learner.learner import Learner
from taskschema_worker.rollout import collect_slots

TOY = get_task("toy")


def collect(learner: Learner, config: RunConfig) -> list[Trajectory]:
    """Return one round of the learner's present policy."""
    snapshot = learner.snapshot()
    slots = collect_slots(
        TOY.make_environment(),
        Policy(snapshot, TOY.pairs, TOY.observation),
        seed=config.seed,
        round_index=snapshot.version,
        slots=range(config.slots),
        episodes_per_slot=config.episodes_per_slot,
        horizon=TOY.horizon,
    )
    return [trajectory for slot in slots for trajectory in slot]


def train(config: RunConfig, rounds: int) -> tuple[Learner, int | None]:
    """Train until 90 % of the last 100 episodes succeed; return the learner and the episodes that it took."""
    learner = Learner(config, TOY)
    recent: list[bool] = []
    for done in range(rounds):
        trajectories = collect(learner, config)
        learner.update(trajectories)
        recent = (recent + [item.success for item in trajectories])[-100:]
        if len(recent) == 100 and sum(recent) >= 90:
            return learner, (done + 1) * len(trajectories)
    return learner, None

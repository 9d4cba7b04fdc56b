"""The scripted expert under the paper's schema, as a policy of the agent."""

import numpy as np

from taskschema.policies import Actions
from taskschema.tasks import get_task

TASK = get_task("lateral-lifting")


class Expert:
    """Grasps the bar at both ends and lifts it so far [m]."""

    def __init__(self, lift: float) -> None:
        self._lift = lift

    def act(self, observations, step, generators) -> Actions:
        pair = TASK.paper_pairs[step] if step < 2 else TASK.pairs.index("no_op", "no_op")
        arguments = TASK.expert_arguments(observations, step)
        for arm in (0, 1):
            arguments[:, TASK.pairs.columns(arm, 1)] = self._lift
        raw = TASK.pairs.to_normalised(arguments).astype(np.float32)
        return Actions(np.array([pair]), raw, arguments)

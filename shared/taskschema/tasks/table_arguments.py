"""From arguments on the table, which policies on images give, to those that skills are planned from."""

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.skills.table_space import LOCATION, OWN_HEIGHT
from taskschema.tasks.task import Task


def offset_arguments(task: Task, arguments: FloatArray, anchors: FloatArray) -> FloatArray:
    """Return what skills take, [M, A'], from arguments [M, A] of `task.image_pairs`.

    Args:
        task: whose skills they are.
        arguments: SI units; locations in the world frame.
        anchors: [M, 3] see `SeenEnvironment.pose_anchors`.
    """
    table = task.image_pairs.argument_names
    columns = []
    for name in task.pairs.argument_names:
        argument = name.rpartition(".")[2]
        if argument == OWN_HEIGHT:
            columns.append(anchors[:, 2])
        elif argument in LOCATION:
            columns.append(arguments[:, table.index(name)] - anchors[:, LOCATION.index(argument)])
        else:
            columns.append(arguments[:, table.index(name)])
    return np.stack(columns, axis=1)

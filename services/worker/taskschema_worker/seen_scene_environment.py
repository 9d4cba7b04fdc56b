"""A scene task's environment with the overhead camera over its table."""

from collections.abc import Sequence

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.frames import FRAME_SHAPE, FRAME_SIZE, Frames
from taskschema.kinematics.sawyer import sawyer_pair
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema_worker.camera_watch import CameraWatch
from taskschema_worker.plan_gate import PlanGate
from taskschema_worker.rendering.looks import Looks
from taskschema_worker.rendering.scene_renderer import SceneRenderer
from taskschema_worker.scene_environment import SceneEnvironment


class SeenSceneEnvironment(SceneEnvironment):
    """N episodes of a scene task, each drawn when it is looked at; see `SeenEnvironment`.

    Args:
        task: whose scene it is.
        threads: of the simulation.
        randomise_visuals: whether every episode that starts from a generator has colours, light and a camera
            pose of its own, drawn after its object: what is simulated is the same with and without.
        gate: see `SceneEnvironment`.

    Raises:
        RenderingError: if nothing on this machine can draw; nothing else is started then.

    """

    def __init__(
        self,
        task: SceneTask,
        threads: int = 1,
        *,
        randomise_visuals: bool = False,
        gate: PlanGate | None = None,
    ) -> None:
        self._renderer = SceneRenderer(task, FRAME_SIZE, FRAME_SIZE)
        self._instances: list[ObjectInstance] = []
        self._randomise_visuals = randomise_visuals
        self._looks: list[Looks] = []
        super().__init__(task, threads, gate=gate)

    def reset(self, generators: Sequence[np.random.Generator]) -> FloatArray:
        """Start one episode per generator; see `BatchEnvironment`."""
        observations = super().reset(generators)
        if self._randomise_visuals:
            self._looks = [self._renderer.draw_looks(generator) for generator in generators]
        return observations

    def reset_to(self, instances: Sequence[ObjectInstance]) -> FloatArray:
        """Start one episode per given object instance; see `SceneEnvironment`."""
        self._instances = list(instances)
        self._watch = CameraWatch()
        return super().reset_to(instances)

    def frames(self, episodes: IntArray) -> Frames:
        """Draw M episodes as they are now: [M, 256, 256, 3].

        Raises:
            FrameError: if an episode looks as it did before although it has visibly moved.

        """
        frames = np.empty((len(episodes), *FRAME_SHAPE), dtype=np.uint8)
        for row, episode in enumerate(episodes):
            self._renderer.set_object(self._instances[episode])
            if self._looks:
                self._renderer.set_looks(self._looks[episode])
            frames[row] = self._renderer.render(self._simulation.positions[episode])
        self._watch.look(episodes, frames, self._places(episodes))
        return frames

    def _places(self, episodes: IntArray) -> FloatArray:
        """Return where both hands and the object are [M, 3, 3]."""
        joints = self._simulation.arm_joints(episodes)
        hands = [arm.forward(joints[:, side])[0] for side, arm in enumerate(sawyer_pair())]
        return np.stack([*hands, self._simulation.object_poses(episodes)[:, :3]], axis=1)

    def pose_anchors(self, episodes: IntArray) -> FloatArray:
        """Return the objects' centres on the table, and where poses without a height go: [M, 3]."""
        anchors = self._simulation.object_poses(episodes)[:, :3]
        anchors[:, 2] = self._task.pose_height * self._sizes[episodes, 2]
        return anchors

    def close(self) -> None:
        """Stop the simulation's threads and give the renderer back."""
        super().close()
        self._renderer.close()

"""How fast pictures are drawn here: `python -m taskschema_worker.rendering.speed` prints milliseconds."""

import time
from statistics import median

from taskschema.tasks.scene_task import SceneTask
from taskschema.frames import FRAME_SIZE
from taskschema_worker.rendering.scene_renderer import SceneRenderer

FRAMES = 30
WARM_UP = 3


def milliseconds_per_frame(task: SceneTask, frames: int = FRAMES) -> list[float]:
    """Return the wall time of each of some overhead frames with the arms at home [ms].

    Raises:
        RenderingError: if nothing on this machine can draw.

    """
    times = []
    with SceneRenderer(task, FRAME_SIZE, FRAME_SIZE) as renderer:
        for _ in range(frames + WARM_UP):
            started = time.perf_counter()
            renderer.render(renderer.home_positions)
            times.append(1e3 * (time.perf_counter() - started))
    return times[WARM_UP:]


def main() -> None:
    """Print the median for lateral lifting."""
    from taskschema.tasks.lateral_lifting import LateralLifting

    print(f"{median(milliseconds_per_frame(LateralLifting())):.1f}")


if __name__ == "__main__":
    main()

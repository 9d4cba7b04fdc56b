"""How fast pictures are drawn here: `python -m taskschema_worker.rendering.speed` prints milliseconds."""

import time
from collections.abc import Callable
from statistics import median

from taskschema.frames import FRAME_SIZE
from taskschema.tasks.scene_task import SceneTask
from taskschema_worker.rendering.scene_renderer import SceneRenderer

FRAMES = 30
WARM_UP = 3


def milliseconds_per_frame(
    task: SceneTask, frames: int = FRAMES, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Return the time of each of some overhead frames with the arms at home [ms], by a clock in seconds.

    Raises:
        RenderingError: if nothing on this machine can draw.

    """
    times = []
    with SceneRenderer(task, FRAME_SIZE, FRAME_SIZE) as renderer:
        for _ in range(frames + WARM_UP):
            started = clock()
            renderer.render(renderer.home_positions)
            times.append(1e3 * (clock() - started))
    return times[WARM_UP:]


def main() -> None:
    """Print the median for lateral lifting."""
    from taskschema.tasks.lateral_lifting import LateralLifting

    print(f"{median(milliseconds_per_frame(LateralLifting())):.1f}")


if __name__ == "__main__":
    main()

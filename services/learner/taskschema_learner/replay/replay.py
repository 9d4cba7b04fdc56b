"""Drawing recorded episodes frame by frame."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from taskschema.arrays import FloatArray
from taskschema.tasks.scene_task import SceneTask
from taskschema_learner.replay.captions import Captions
from taskschema_learner.replay.response_overlay import ResponseOverlay
from taskschema_worker.recording import RecordedEpisode
from taskschema_worker.rendering.frame import Frame
from taskschema_worker.rendering.scene_renderer import SceneRenderer

BEGINNING_SECONDS, END_SECONDS = 0.5, 1.2
"""How long an episode's first and last picture stand still [s]."""


@dataclass(frozen=True)
class Look:
    """How a film looks."""

    camera: str = "front"
    width: int = 640
    """[pixel]"""
    height: int = 480
    """[pixel]"""
    step: int | None = None
    """The only step that is shown, from 1; None: all."""


def draw_episodes(
    task: SceneTask,
    episodes: Sequence[RecordedEpisode],
    rate: float,
    look: Look,
    title: str,
    overlay: ResponseOverlay | None = None,
) -> Iterator[Frame]:
    """Yield the frames of some episodes, one after the other, in real time.

    Args:
        task: whose scene it is.
        episodes: what is shown.
        rate: frames per second.
        look: camera and size.
        title: what stands in the corner.
        overlay: laid over the pictures, which must be the overhead camera's; None: nothing.

    Raises:
        RenderingError: if nothing on this machine can draw.

    """
    captions = Captions(look.height)
    with SceneRenderer(task, look.width, look.height, look.camera, fine=True) as renderer:
        for episode in episodes:
            renderer.set_object(episode.instance)
            view = _View(renderer, captions, overlay)
            for frame in _episode(view, episode, rate, look.step):
                captions.title(frame, title)
                yield frame


@dataclass(frozen=True)
class _View:
    """What draws a film's pictures."""

    renderer: SceneRenderer
    captions: Captions
    overlay: ResponseOverlay | None

    def picture(self, positions: FloatArray) -> Frame:
        """Return the picture of a state `qpos` [nq], with the overlay if there is one."""
        drawn = self.renderer.render(positions)
        return drawn if self.overlay is None else self.overlay.tint(drawn)


def _episode(view: _View, episode: RecordedEpisode, rate: float, only: int | None) -> Iterator[Frame]:
    captions = view.captions
    every = max(1, round(1 / (rate * episode.timestep)))
    beginning = episode.start
    for number, step in enumerate(episode.steps, start=1):
        if only in (None, number):
            words = f"left: {_words(step.left)}", f"step {number}", f"right: {_words(step.right)}"
            if view.overlay is not None:
                view.overlay.look_at(episode.instance, beginning)
            picture = view.picture(beginning)
            is_first, is_last = only == number or number == 1, only is None and number == len(episode.steps)
            yield from _still(captions, picture, words, None, BEGINNING_SECONDS * rate if is_first else 0)
            for positions in step.positions[every - 1 :: every]:
                picture = view.picture(positions)
                yield from _still(captions, picture, words, None, 1)
            outcome = episode.success if is_last else None
            yield from _still(captions, picture, words, outcome, END_SECONDS * rate if is_last or only else 0)
        beginning = step.positions[-1] if step.positions else beginning


def _still(
    captions: Captions, picture: Frame, words: tuple[str, str, str], outcome: bool | None, count: float
) -> Iterator[Frame]:
    left, middle, right = words
    for _ in range(round(count)):
        frame = picture.copy()
        captions.write(frame, left, middle, right, outcome)
        yield frame


def _words(skill: str) -> str:
    """Return a skill's name as a person writes it."""
    return skill.replace("_", " ").replace("go to", "go-to").replace("no op", "no-op")

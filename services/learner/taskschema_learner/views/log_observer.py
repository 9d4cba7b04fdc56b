"""What a program sees of a training: one line of JSON for its start, for every round, and for its end."""

import logging

from taskschema.metrics import RoundMetrics
from taskschema.schema import SchemaView
from taskschema_learner.logs import RunLog
from taskschema_learner.runs.progress import Progress
from taskschema_learner.training import TrainingContext

log = logging.getLogger("taskschema.training")


class LogObserver:
    """Logs a training; the API's token is a secret and never among it.

    Args:
        run_log: moves into the run's folder when that is there.
        resume_command: what a person types to go on after a stop.

    """

    def __init__(self, run_log: RunLog, resume_command: str) -> None:
        self._run_log = run_log
        self._resume_command = resume_command

    def on_start(self, context: TrainingContext, rounds_done: int, progress: Progress) -> None:
        """Say what is trained, with what and where."""
        self._folder = context.folder.path
        self._run_log.write_to(self._folder)
        if context.api_token is not None:
            log.warning("The API's token was generated and is not logged: set TASKSCHEMA_API_TOKEN.")
        facts = {
            "task": context.task.name,
            "folder": str(self._folder),
            "agent": context.agent,
            "workers": context.workers or 0,
            "api": context.api_url,
            "rounds_done": rounds_done,
            "episodes": progress.episodes,
        }
        log.info("Training starts", extra={"facts": facts})

    def on_collecting(self, slots_done: int, slots: int) -> None:
        """Say nothing: a line for each slot would be too many."""

    def on_round(self, metrics: RoundMetrics, schema: SchemaView, used_steps: int | None) -> None:
        """Say what the round came to."""
        facts = {
            name: getattr(metrics, name)
            for name in ("policy_version", "episodes", "steps", "success_rate", "success_last_100")
        }
        best = [f"{item.left}, {item.right}" for item in schema.best(used_steps)]
        facts |= {"schema": best, "seconds_collect": round(metrics.seconds_collect, 3)}
        log.info("Round done", extra={"round": metrics.round, "facts": facts})

    def on_finish(self, reason: str, finished: bool) -> None:
        """Say why it ended, and how to go on; draw the curve of a run that is finished."""
        facts = {"finished": finished} | ({} if finished else {"resume": self._resume_command})
        log.info("Training ended: %s", reason, extra={"facts": facts})
        if finished:
            from taskschema_learner.views.plots import draw_curve

            draw_curve(self._folder)

    def close(self) -> None:
        """Nothing is open."""

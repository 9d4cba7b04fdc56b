"""What a person sees of a training in the terminal, or in a log file of continuous integration."""

import time
from collections import deque

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from taskschema.config import PolicyKind
from taskschema.metrics import RoundMetrics
from taskschema.schema import BestPair, SchemaView
from taskschema_learner.logs import RunLog
from taskschema_learner.runs.progress import Progress
from taskschema_learner.schemas.schema_report import compare, schema_words
from taskschema_learner.schemas.schema_table import schema_table
from taskschema_learner.training import TrainingContext
from taskschema_learner.views.time_left import seconds_left, words

LINE_SECONDS = 2.0
"""Least time between two lines where there is no terminal [s]."""
RATE_ROUNDS = 10
"""Rounds over which episodes per second are counted."""


class TerminalObserver:
    """Shows a training: live where there is a terminal, as lines where there is none.

    Args:
        console: where to write.
        log: moves into the run's folder when that is there.
        resume_command: what a person types to go on after a stop.
        policy: what is trained; the `state` policy has no schema to show.

    """

    def __init__(
        self, console: Console, log: RunLog, resume_command: str, policy: PolicyKind = "schema"
    ) -> None:
        self._console = console
        self._log = log
        self._policy = policy
        self._resume_command = resume_command
        self._rows: list[RoundMetrics] = []
        self._schema: SchemaView | None = None
        self._used_steps: int | None = None
        self._slots = (0, 1)
        self._ends: deque[tuple[float, int]] = deque(maxlen=RATE_ROUNDS + 1)
        self._live: Live | None = None
        self._last_line = 0.0

    def on_start(self, context: TrainingContext, rounds_done: int, progress: Progress) -> None:
        """Say what is trained, with what and where."""
        self._context = context
        self._log.write_to(context.folder.path)
        self._started = time.monotonic()
        self._ends.append((self._started, progress.episodes))
        self._say(f"Training {context.task.name}: {context.task.summary}")
        self._say(f"Run folder: {context.folder.path} ({_crew(context)}); stops at {_goal(context)}.")
        if context.api_url is not None:
            self._say(f"API: {context.api_url} (documentation: {context.api_url}/docs)")
        if context.api_token is not None and self._console.is_terminal:  # elsewhere it would be logged
            self._say(f"Token for requests that change something: {context.api_token}")
        if rounds_done:
            self._say(f"Going on after {rounds_done} rounds, {progress.episodes:,} episodes.")
        if self._console.is_terminal:
            self._live = Live(console=self._console, get_renderable=self._render, refresh_per_second=4)
            self._live.start()

    def on_collecting(self, slots_done: int, slots: int) -> None:
        """Note how far the round is."""
        self._slots = (slots_done, slots)

    def on_round(self, metrics: RoundMetrics, schema: SchemaView, used_steps: int | None) -> None:
        """Show the round's outcome and the schema as it forms."""
        self._rows.append(metrics)
        self._schema, self._used_steps = (None if self._policy == "state" else schema), used_steps
        self._slots = (0, self._slots[1])
        self._ends.append((time.monotonic(), metrics.episodes))
        if self._live is None and time.monotonic() - self._last_line >= LINE_SECONDS:
            self._last_line = time.monotonic()
            self._say(self._line(metrics))

    def on_finish(self, reason: str, finished: bool) -> None:
        """Say why it ended, which schema was found, where the run is, and how to go on."""
        self.close()
        if self._rows:
            last = self._rows[-1]
            minutes = (time.monotonic() - self._started) / 60
            self._say(
                f"{'Finished' if finished else 'Stopped'}: {reason}; {last.episodes:,} episodes, "
                f"{last.policy_version} rounds, {minutes:.1f} min in this session."
            )
        else:
            self._say(f"{'Finished' if finished else 'Stopped'}: {reason}.")
        if self._schema is not None:
            best = self._schema.best(self._used_steps)
            self._console.print(schema_table(best))
            found = "Schema given" if self._policy == "oracle" else "Schema found"
            self._say(f"{found}: {_finding(self._context, best)}")
        self._say(f"Run folder: {self._context.folder.path}")
        if finished:
            self._draw_curve()
        else:
            self._say(f"Continue with: {self._resume_command}")

    def close(self) -> None:
        """Leave the terminal as it was; also when training fails."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _say(self, text: str) -> None:
        """Print a line; names of folders and the like are never cut in two."""
        self._console.print(text, soft_wrap=True, markup=False)

    def _draw_curve(self) -> None:
        from taskschema_learner.views.plots import draw_curve

        picture = draw_curve(self._context.folder.path)
        if picture is not None:
            self._say(f"Learning curve: {picture}")

    @property
    def episodes_per_second(self) -> float:
        """Pace over the last rounds."""
        (start, before), (end, after) = self._ends[0], self._ends[-1]
        return (after - before) / (end - start) if end > start else 0.0

    def _line(self, row: RoundMetrics) -> str:
        schema = self._schema.best(self._used_steps) if self._schema is not None else []
        pairs = "; ".join(f"{item.t}: {item.left}, {item.right} {item.probability:.0%}" for item in schema)
        pairs = f"  schema {pairs}" if pairs else ""
        return (
            f"round {row.policy_version}  episodes {row.episodes:,}  {self.episodes_per_second:.1f}/s"
            f"  success {row.success_last_100:.0%} of last 100  time left {self._time_left()}{pairs}"
        )

    def _time_left(self) -> str:
        return words(seconds_left(self._rows, self._context.limits))

    def _render(self) -> RenderableType:
        limits = self._context.limits
        row = self._rows[-1] if self._rows else None
        success = row.success_last_100 if row else 0.0
        rounds = row.policy_version if row else 0
        grid = Table.grid(padding=(0, 2))
        done, slots = self._slots
        grid.add_row("this round", _bar(done / max(1, slots)), f"slot {done} of {slots}")
        if limits.until_success is not None:
            share = success / limits.until_success if limits.until_success else 1.0
            grid.add_row(
                "success", _bar(share), f"{success:.0%} of the last 100, to {limits.until_success:.0%}"
            )
        if limits.rounds is not None:
            grid.add_row("rounds", _bar(rounds / limits.rounds), f"{rounds} of {limits.rounds}")
        episodes = f"{row.episodes if row else self._ends[0][1]:,} episodes"
        facts = f"{episodes}, {self.episodes_per_second:.1f} a second, time left: {self._time_left()}"
        parts: list[RenderableType] = [grid, Text(facts)]
        if self._schema is not None:
            parts.append(schema_table(self._schema.best(self._used_steps), self._schema))
        return Group(*parts)


def _bar(share: float) -> ProgressBar:
    return ProgressBar(total=1.0, completed=min(1.0, max(0.0, share)), width=30)


def _goal(context: TrainingContext) -> str:
    limits = context.limits
    goals = []
    if limits.until_success is not None:
        goals.append(f"{limits.until_success:.0%} success over the last 100 episodes")
    if limits.rounds is not None:
        goals.append(f"{limits.rounds} rounds")
    return " or ".join(goals) or "Ctrl-C"


def _crew(context: TrainingContext) -> str:
    if context.agent == "robot":
        return f"waiting for `taskschema-robot run {context.folder.path}`"
    if context.workers is None:
        return "in this process"
    if context.workers == 0:
        return "0 workers asked for: `taskschema scale N`"
    return f"{context.workers} workers"


def _finding(context: TrainingContext, best: list[BestPair]) -> str:
    comparison = compare(context.task, best)
    return f"{schema_words(comparison.found)}, {comparison.sentence}"

"""Requests and answers that exist only in the API; shared structures are described by `struct_models`."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag

from taskschema.bus.run_status import RunStatus
from taskschema.bus.worker_info import WorkerInfo
from taskschema.config import RunConfig
from taskschema.metrics import RoundMetrics
from taskschema.schema import SchemaDocument
from taskschema_learner.api.struct_models import model_of

LARGEST_INTEGER = 2**53 - 1
"""Largest integer that every JSON reader keeps exact."""


def _integral(value: Any) -> Any:  # noqa: ANN401 - anything can be sent
    """Return a whole number as an integer: JSON makes no difference between 4 and 4.0."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


WHOLE = BeforeValidator(_integral)
"""Lets a strict integer be written with a decimal point, too."""

SchemaAnswer = model_of(SchemaDocument)
CurveRow = model_of(RoundMetrics)
StatusAnswer = model_of(RunStatus)
WorkerAnswer = model_of(WorkerInfo)
ConfigAnswer = model_of(RunConfig)


class ApiModel(BaseModel):
    """Base of requests and answers: immutable, no unknown fields, described by attribute docstrings."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, use_attribute_docstrings=True, ser_json_inf_nan="null"
    )


class Problem(ApiModel):
    """Why a request was not answered."""

    detail: str
    """One line that says what to do."""


class Health(ApiModel):
    """Whether the API answers."""

    status: Literal["ok", "ready"]


class RunSummary(ApiModel):
    """A run in the list of runs."""

    run: str
    task: str
    policy: str
    """`schema`, `state` or `oracle`."""
    seed: int
    state: str
    """What the run is doing: `starting`, `running`, `paused`, `finished`, `stopped` or `failed`."""
    version: int
    """Policy version: the number of updates so far."""
    updated_at: str
    """UTC time of its latest sign of life, ISO 8601; empty if it gave none yet."""


class RunList(ApiModel):
    """All runs that this API serves."""

    runs: list[RunSummary]


class RunAnswer(ApiModel):
    """Everything about a run but its curve and its schema."""

    run: str
    config: ConfigAnswer  # type: ignore[valid-type]
    config_hash: str
    """SHA-256 of the config: equal configs give equal results."""
    status: StatusAnswer  # type: ignore[valid-type]
    latest: CurveRow | None  # type: ignore[valid-type]
    """The newest round, if one is done."""
    worker_target: int | None
    """Workers that somebody asked for; null: as many as there is capacity for."""
    workers: int
    """Workers that are alive."""


class Curve(ApiModel):
    """The learning curve: one row per round."""

    run: str
    rounds: list[CurveRow]  # type: ignore[valid-type]


class Workers(ApiModel):
    """The workers of a run."""

    run: str
    target: int | None
    """Workers that somebody asked for; null: as many as there is capacity for."""
    live: int
    """Workers that gave a sign of life lately."""
    workers: list[WorkerAnswer]  # type: ignore[valid-type]


class WorkerTarget(ApiModel):
    """How many workers are wanted."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"target": 4}, {"target": None}]})

    target: Annotated[int, Field(strict=True, ge=1, le=10_000), WHOLE] | None
    """Number of workers, at most the capacity is used; null: as many as there is capacity for."""


class RequestAnswer(ApiModel):
    """A request that was handed to the run."""

    run: str
    requested: Literal["pause", "resume", "stop"]
    state: str
    """What the run was doing when the request came; it follows within a second, or when it runs again."""


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


def _observation_form(value: Any) -> str | None:  # noqa: ANN401 - anything can be sent
    forms: dict[type, str] = {dict: "fields", list: "vector", str: "frame"}
    return forms.get(type(value))


Observation = Annotated[
    Annotated[dict[str, Number | list[Number]], Tag("fields")]
    | Annotated[list[Number], Tag("vector")]
    | Annotated[str, Tag("frame")],
    Discriminator(
        _observation_form,
        custom_error_type="observation_form",
        custom_error_message=(
            "must be an object of fields or a list of numbers, or on images a string: see GET /policy/meta"
        ),
    ),
]


class ActRequest(ApiModel):
    """An observation to act on."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "observation": {
                        "handles": [0.01, -0.05, 0.02, 0.06],
                        "holding": [0, 0],
                        "timestep": [1, 0, 0],
                    },
                    "step": 0,
                },
                {"observation": [0.01, -0.05, 0.02, 0.06, 1, 1, 0, 1, 0], "step": 1, "mode": "mean"},
            ]
        }
    )

    observation: Observation
    """SI values by field name, or the flat vector of D numbers; GET /policy/meta lists the fields. Of a run
    on images: the frame's 256 x 256 x 3 bytes, RGB, row by row from the top, in base64."""
    step: Annotated[int, Field(strict=True, ge=0, le=LARGEST_INTEGER), WHOLE]
    """Step of the episode, from 0 to T - 1 (row `t` = step + 1 of the schema)."""
    mode: Literal["sampled", "mean"] = "sampled"
    """`sampled`: draw pair and arguments, as in training; `mean`: the most probable pair, mean arguments."""
    seed: Annotated[int, Field(strict=True, ge=0, le=LARGEST_INTEGER), WHOLE] | None = None
    """Makes a sampled answer repeatable; null: a random one, which the answer tells."""
    response_maps: bool = False
    """Of a run on images: whether to answer with both arms' distributions over the table, too."""


class ArgumentValue(ApiModel):
    """A continuous argument of a skill, inside its search space."""

    value: float
    unit: str
    """`m` or `rad`."""


class SkillCall(ApiModel):
    """What one arm does."""

    skill: str
    arguments: dict[str, ArgumentValue]
    """By name, in the skill's order; empty for a skill without arguments."""


class ResponseMaps(ApiModel):
    """Where on the table each arm would go: probabilities of 8 x 8 cells."""

    x: tuple[float, float]
    """From the left edge of the first column to the right edge of the last, world frame [m]."""
    y: tuple[float, float]
    """From the lower edge of the last row to the upper edge of the first, world frame [m]."""
    left: list[list[float]]
    right: list[list[float]]


class ActAnswer(ApiModel):
    """What both arms do in this step, at the same time."""

    run: str
    version: int
    """Policy version that acted."""
    step: int
    mode: Literal["sampled", "mean"]
    seed: int | None
    """Seed of a sampled answer; null for the mean."""
    pair: tuple[str, str]
    """Left and right skill."""
    left: SkillCall
    right: SkillCall
    response_maps: ResponseMaps | None = None
    """Null unless they were asked for."""


class TensorAnswer(ApiModel):
    """An array in the safetensors bytes."""

    name: str
    dtype: str
    shape: list[int]


class FieldAnswer(ApiModel):
    """A field of the observation vector."""

    name: str
    size: int
    unit: str
    meaning: str


class ArgumentAnswer(ApiModel):
    """An entry of the argument vector and its search space."""

    name: str
    """`ARM.SKILL.ARGUMENT`."""
    unit: str
    low: float
    high: float
    periodic: bool
    """Whether it wraps (a full turn) instead of being clipped."""
    meaning: str


class PolicyMeta(ApiModel):
    """What the bytes of GET /policy hold, and what goes in and comes out."""

    run: str
    task: str
    policy: str
    version: int
    sha256: str
    """Hash over names, shapes and bytes of weights and logits; the ETag of GET /policy."""
    size: int
    """Bytes."""
    horizon: int
    pairs: list[tuple[str, str]]
    tensors: list[TensorAnswer]
    observation: list[FieldAnswer]
    arguments: list[ArgumentAnswer]

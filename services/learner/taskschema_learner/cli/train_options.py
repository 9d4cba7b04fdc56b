"""The options of `taskschema train`, each with the help that `--help` shows."""

from pathlib import Path
from typing import Annotated

import typer

_LEARN, _END, _PLACE = "What is learned", "When it ends", "Where and with what"

Task = Annotated[
    str | None, typer.Argument(metavar="TASK", help="Task to learn: see `taskschema tasks`. Try `toy` first.")
]
TaskFile = Annotated[
    str | None,
    typer.Option(metavar="FILE:CLASS", help="A task of your own instead of TASK.", rich_help_panel=_LEARN),
]
Policy = Annotated[
    str,
    typer.Option(
        metavar="schema|state|oracle",
        help="schema: the paper's method; state: its baseline without a schema; oracle: the schema given.",
        rich_help_panel=_LEARN,
    ),
]
Observation = Annotated[
    str, typer.Option(metavar="state|image", help="What the policy sees.", rich_help_panel=_LEARN)
]
Trunk = Annotated[
    str,
    typer.Option(
        metavar="small|vgg16",
        help="With images: a small trunk trained from scratch, or the paper's VGG16, frozen.",
        rich_help_panel=_LEARN,
    ),
]
VggWeights = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="torchvision's published weights of VGG16 (.pth or .safetensors); implies --trunk vgg16.",
        rich_help_panel=_LEARN,
    ),
]
RandomiseVisuals = Annotated[
    bool,
    typer.Option(
        "--randomise-visuals",
        help="With images: vary colours, light and the camera's pose from episode to episode.",
        rich_help_panel=_LEARN,
    ),
]
Seed = Annotated[
    int, typer.Option(help="A run's results follow from its config and seed.", rich_help_panel=_LEARN)
]
Slots = Annotated[
    int, typer.Option(help="Slots a round, of 4 episodes each (paper: 50).", rich_help_panel=_LEARN)
]
InitSchema = Annotated[
    str | None,
    typer.Option(metavar="FILE_OR_RUN", help="Start from a schema learned before.", rich_help_panel=_LEARN),
]
FreezeSchema = Annotated[
    bool, typer.Option("--freeze-schema", help="Leave the schema as it starts.", rich_help_panel=_LEARN)
]
InitPolicy = Annotated[
    str | None,
    typer.Option(
        metavar="FILE_OR_RUN",
        help="Start the argument network from a policy learned before; the paper transfers the schema only.",
        rich_help_panel=_LEARN,
    ),
]
SafetyGate = Annotated[
    bool,
    typer.Option(
        "--safety-gate",
        help="Refuse in simulation what the robot's safety gate would refuse before a motion.",
        rich_help_panel=_LEARN,
    ),
]
SchemaPublicKey = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        envvar="TASKSCHEMA_SCHEMA_PUBLIC_KEY",
        help="Take --init-schema only from a file that the owner of this public key signed.",
        rich_help_panel=_LEARN,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="FIELD=VALUE",
        help="Set any field of the config, such as ppo.learning_rate=0.005; may be repeated.",
        rich_help_panel=_LEARN,
    ),
]
UntilSuccess = Annotated[
    float,
    typer.Option(
        min=0,
        max=1,
        help="Success over the last 100 episodes that is enough; 0: go on for ever.",
        rich_help_panel=_END,
    ),
]
Rounds = Annotated[int | None, typer.Option(min=1, help="Rounds in all.", rich_help_panel=_END)]
Resume = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Go on with a run that was stopped; its config comes from its folder.",
        rich_help_panel=_PLACE,
    ),
]
RunDir = Annotated[
    Path | None,
    typer.Option(
        help="The run's folder. Default: runs/TASK-POLICY-seedN, with a number if there is one already.",
        rich_help_panel=_PLACE,
    ),
]
Agent = Annotated[
    str,
    typer.Option(
        metavar="simulation|robot",
        help="Who runs the episodes. robot: one-episode slots and the paper's settings for the robot; "
        "waits for `taskschema-robot run`.",
        rich_help_panel=_PLACE,
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        min=0, help="Rollout workers. Default: the cores. 0: in this process.", rich_help_panel=_PLACE
    ),
]
Redis = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        envvar="TASKSCHEMA_REDIS_URL",
        help="A Redis to use instead of one inside the run's folder.",
        rich_help_panel=_PLACE,
    ),
]
Ray = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="A Ray cluster to use instead of a local one, such as auto or HOST:PORT.",
        rich_help_panel=_PLACE,
    ),
]
Device = Annotated[
    str, typer.Option(metavar="cpu|cuda", help="Where the learner computes.", rich_help_panel=_PLACE)
]
Api = Annotated[
    str,
    typer.Option(
        metavar="HOST:PORT", help="Where the HTTP API listens; none: nowhere.", rich_help_panel=_PLACE
    ),
]
ApiTlsCert = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="TLS for the API: its certificate, as PEM.", rich_help_panel=_PLACE),
]
ApiTlsKey = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="The certificate's key without a password, as PEM.", rich_help_panel=_PLACE
    ),
]
LogFormat = Annotated[
    str,
    typer.Option(
        metavar="text|json",
        envvar="TASKSCHEMA_LOG_FORMAT",
        help="text: for people; json: a line of JSON for every event, on standard error.",
        rich_help_panel=_PLACE,
    ),
]

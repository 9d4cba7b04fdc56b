"""Options that several subcommands share."""

from typing import Annotated

import typer

TwinAddress = Annotated[
    str, typer.Option("--twin", metavar="URL", help="The twin's control address, as `twin` prints it.")
]
LeftAddress = Annotated[
    str | None,
    typer.Option("--left", metavar="URL", help="Left robot's rosbridge; for pyrobot, its ROS master."),
]
RightAddress = Annotated[
    str | None, typer.Option("--right", metavar="URL", help="The same of the right robot.")
]
DriverName = Annotated[
    str,
    typer.Option("--driver", metavar="rosbridge|pyrobot", help="How real robots are driven."),
]
PyrobotPython = Annotated[
    str, typer.Option(metavar="FILE", help="Python that PyRobot is installed for, with --driver pyrobot.")
]

"""The command `selfmotion follow`: a path in a closed loop with a controller."""

from typing import Annotated

import typer

import selfmotion as sm
from selfmotion import realtime
from selfmotion.shell.cli import documents, options, outputs
from selfmotion.shell.cli.app import LOOP, NOT_VERIFIED, VERIFIED, app, print_json, stages, terminal

# Keys of problem files that a closed loop has no use for.
_KEYS_OF_PLANS = ("null_motion", "rest", *documents.HOW_TO_PLAN)


@app.command(
    epilog="Example: selfmotion follow cell.toml --listen 127.0.0.1:5005", rich_help_panel=LOOP
)
def follow(
    file: options.DocumentArgument,
    listen: Annotated[
        str, typer.Option(help="host:port to wait for states at.")
    ] = "127.0.0.1:5005",
    settings: options.SetOption = None,
    allow_code: options.AllowCodeOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Follow a path in a closed loop with a controller: states come by UDP, set-points go back.

    A state is t, q, q̇ as doubles. The answer has a row t, q, q̇, q̈ for each cycle, and ends at
    rest, in case the next one is late. The path begins with the first state; an empty datagram
    ends the loop. The table loop of the file (or --set loop.period=0.01) has horizon, period,
    cycle, latency, silence and seconds. Exit code 0 if every segment was planned.
    """
    from selfmotion.shell.cli import following

    document = documents.document_of(file, settings)
    loop = following.loop_of(document, file)
    problem = documents.of_file(file, documents.DocumentOptions(settings), allow_code).problem
    left = [key for key in document if key in _KEYS_OF_PLANS]
    if left:
        outputs.print_notes(
            [f"{file}: {', '.join(left)}: of plans, and left out while the arm moves"]
        )
    replanner = following.replanner_of(problem, **loop.of_replanner)
    # An arm that cannot reach the whole path moves as far as it can: say so before it moves.
    if beyond := following.out_of_reach(problem):
        outputs.print_notes([beyond])
    with following.listening(listen) as port:
        # Nothing compiles once the arm moves.
        sm.warm_up(replanner)
        stages.print(f"waits for states at {listen}", markup=False)
        link = following.Link(port, problem.path, replanner.limits, _print_line, loop)
        try:
            realtime.follow(replanner, link.read, link.write, lead=loop.latency)
        except KeyboardInterrupt:
            link.ended = "stopped"
    if as_json:
        print_json(link.summary)
    else:
        following.show_link(link, terminal)
    raise typer.Exit(VERIFIED if link.is_followed else NOT_VERIFIED)


def _print_line(text: str) -> None:
    stages.print(text, markup=False, soft_wrap=True)

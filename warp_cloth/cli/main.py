"""The ``warp-cloth`` command: its subcommands by purpose, its exit statuses."""

from __future__ import annotations

import re
import sys
from typing import Annotated, Any

import typer

from warp_cloth.cli.explore import avatar, pattern, scenes
from warp_cloth.cli.fabric import fabric
from warp_cloth.cli.fit import fit
from warp_cloth.cli.help import HelpfulCommand
from warp_cloth.cli.init import init
from warp_cloth.cli.many import batch, sizes
from warp_cloth.cli.resident import resident_of
from warp_cloth.cli.results import compare, view
from warp_cloth.cli.serve import serve
from warp_cloth.cli.study import plan, tradeoff
from warp_cloth.cli.terminal import BAD_INPUT, INTERRUPTED, keep_interrupts, print_error
from warp_cloth.cli.warm_up import warm_up

app = typer.Typer(
    name="warp-cloth",
    help="Garment fitting on NVIDIA Warp: the shape of a garment as worn on a body, with a certificate that it is at "
    "rest.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for panel, commands in (
    ("Fit", (fit, init, batch, sizes, compare, view, serve)),
    ("Explore", (scenes, pattern, fabric, avatar)),
    ("Study", (plan, tradeoff)),
    ("Set up", (warm_up, resident_of(lambda: main()))),
):
    for command in commands:
        app.command(rich_help_panel=panel, cls=HelpfulCommand)(command)


def main() -> None:
    """Entry point of the ``warp-cloth`` command; wrong usage and interrupts end it with one line."""
    keep_interrupts()
    try:
        code = app(standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted", file=sys.stderr)
        code = INTERRUPTED
    except OSError as error:
        if error.errno is None:
            raise
        print_error(f"{error.filename or 'output'}: {error.strerror}; free some space, or check the permissions")
        code = BAD_INPUT
    except Exception as error:
        # the class of wrong usage is in different places in different versions of typer
        if not hasattr(error, "format_message"):
            raise
        code = getattr(error, "exit_code", BAD_INPUT)
        if type(error).__name__ == "NoArgsIsHelpError":
            print(error.format_message(), file=sys.stderr)
        else:
            print_error(_usage(error))
    sys.exit(code)


def _usage(error: Any) -> str:
    """What is wrong with a command as it was typed, by its option, and where to read more."""
    names = [each.callback.__name__.replace("_", "-") for each in app.registered_commands if each.callback is not None]
    message = error.format_message().rstrip(".")
    option = re.fullmatch(r"Invalid value for '(--[\w-]+)[^']*': (.*?)(?:, unable to parse.*)?", message)
    if option is not None:
        message = f"{option[1]}: {option[2].replace('Input should be', 'must be')}"
    unknown = re.match(r"No such option: --([\w-]+)", message)
    if unknown is not None:
        from warp_cloth.scene.reference import keys_called

        keys = keys_called(unknown[1].replace("-", "_"))
        if keys:  # of a scene: these are no options
            ways = " or ".join(f"--set {key}=..." for key in keys)
            message = f"No such option: --{unknown[1]}; a key of the scene? {ways}"
    command = getattr(getattr(error, "ctx", None), "info_name", None)
    return f"{message} (see warp-cloth {f'{command} ' if command in names else ''}--help)"


def _show_version(requested: bool) -> None:
    if requested:
        from warp_cloth.base.version import package_version

        typer.echo(f"warp-cloth {package_version()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    pass

"""The command line: ``crowd`` with its commands run, view, list, motions, export and bench.

Exit codes: 0 done; 1 the run is not what the scenario expects (with ``--check``), or a benchmark case failed;
2 something that the user gave cannot be used; 130 stopped by Ctrl-C.
"""

import sys
from collections.abc import Sequence
from typing import cast

import typer

from crowd.cli.export import export
from crowd.cli.run import run
from crowd.cli.showing import view
from crowd.errors import CrowdError

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130

# The base of what typer raises for a command line that it cannot use.
UsageError = cast("type[Exception]", typer.BadParameter.__mro__[1])

app = typer.Typer(
    name="crowd",
    help="Simulate crowds of whole people.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command()(run)
app.command()(export)
app.command()(view)


@app.command("list")
def list_scenarios() -> None:
    """List the scenarios that come with the engine."""
    from crowd.cli.listing import print_scenarios

    print_scenarios()


@app.command(
    add_help_option=False,
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
)
def bench(context: typer.Context) -> None:
    """Measure frames per second against the number of characters (see ``crowd bench --help``)."""
    from crowd.bench.command import app as bench_app

    result = bench_app(args=list(context.args), prog_name="crowd bench", standalone_mode=False)
    if isinstance(result, int) and result:
        raise typer.Exit(result)


@app.command(
    add_help_option=False,
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
)
def motions(context: typer.Context) -> None:
    """Import captured motion, and show motion libraries (see ``crowd motions --help``)."""
    from crowd.cli.motions import app as motions_app

    result = motions_app(args=list(context.args), prog_name="crowd motions", standalone_mode=False)
    if isinstance(result, int) and result:
        raise typer.Exit(result)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Instead of those of the process.
    """
    sys.exit(exit_code(arguments))


def exit_code(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; errors of the user become lines on the error stream."""
    try:
        args = None if arguments is None else list(arguments)
        result = app(args=args, prog_name="crowd", standalone_mode=False)
    except CrowdError as error:
        print(error, file=sys.stderr)
        return EXIT_BAD_INPUT
    except UsageError as error:
        message = error.format_message() if hasattr(error, "format_message") else str(error)
        # Without arguments the message is the help text, which was not asked for as an error.
        print(message if "\n" in message else f"crowd: {message}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except (KeyboardInterrupt, typer.Abort):
        print("crowd: stopped", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has left; there is nobody to tell.
        sys.stdout = None
        return 0
    return result if isinstance(result, int) else 0

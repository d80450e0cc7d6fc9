# PYTHON_ARGCOMPLETE_OK
"""The command line: ``tetlux run``, ``tetlux check``, ``tetlux list`` and others."""

import argparse
import contextlib
import functools
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from tetlux.cases import commands as does
from tetlux.cases.interrupts import treat_signals_as_interrupts
from tetlux.cases.start import mark_start

# Modules that need numpy take half a second to import, so they are imported where they are used: --help, list and show
# then answer at once.


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default those of the process.

    Returns
    -------
    int
        0 if all went well, 1 if some case failed, 2 if the request itself is wrong, 130 if it was interrupted.
    """
    mark_start()
    try:
        treat_signals_as_interrupts()
        return _main(arguments)
    except KeyboardInterrupt:
        return _report("interrupted; finished cases are kept.", 130)


def _main(arguments: Sequence[str] | None) -> int:
    parser = _parser()
    if "_ARGCOMPLETE" in os.environ:
        _complete(parser)
    options = parser.parse_args(arguments)
    try:
        code = int(options.command(options))
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        # Most likely of standard output. A broken pipe only means that its reader, such as head, has ended.
        return 1 if isinstance(error, BrokenPipeError) else _report(f"stopped: {error}; finished cases are kept.", 1)
    except Exception as error:
        return _exit_code_of(error)
    return code


def _complete(parser: argparse.ArgumentParser) -> None:
    """Print what completes a command line, as the shell asks for, and exit; nothing without argcomplete."""
    with contextlib.suppress(ImportError):
        import argcomplete  # noqa: PLC0415 - an extra

        argcomplete.autocomplete(parser)


def _exit_code_of(error: Exception) -> int:
    """Print the sentence of a user's error and return its exit code; raise any other error again."""
    from tetlux.meshing.errors import TetluxError, memory_ran_out  # noqa: PLC0415

    if isinstance(error, TetluxError):
        return _report(str(error), 2)
    if isinstance(error, MemoryError | RuntimeError) and memory_ran_out(error):
        return _report("memory ran out; finished cases are kept.", 1)
    raise error


def _report(sentence: str, code: int) -> int:
    """Print a sentence and return the exit code that it explains."""
    print(f"tetlux: {sentence}", file=sys.stderr)
    return code


class _Parser(argparse.ArgumentParser):
    """A parser that suggests a command for a misspelt one."""

    def error(self, message: str) -> NoReturn:
        invalid = re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message)
        if invalid:
            from tetlux.cases.hints import did_you_mean  # noqa: PLC0415

            commands = re.findall(r"[\w-]+", invalid[2])
            hint = did_you_mean(invalid[1], commands)
            message = f'there is no command "{invalid[1]}"; {hint}the commands are {", ".join(commands)}.'
        unknown = re.search(r"unrecognized arguments: (--[\w-]+)", message)
        if unknown:
            from tetlux.cases.hints import did_you_mean  # noqa: PLC0415

            options = sorted(set(re.findall(r"--[\w-]+", _all_help())))
            message = f"there is no option {unknown[1]}; {did_you_mean(unknown[1], options)}see --help."
        super().error(message)


def _all_help() -> str:
    """The help of all commands."""
    actions = [action for action in _parser()._actions if isinstance(action, argparse._SubParsersAction)]
    return "".join(each.format_help() for action in actions for each in action.choices.values())


class _Version(argparse.Action):
    """Prints the version, and looks it up only when asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version  # noqa: PLC0415

        print(f"tetlux {version('tetlux')}")
        parser.exit()


@functools.cache
def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="tetlux", description="Solve light diffusion through bodies of any shape, by tetrahedral finite elements."
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    run = commands.add_parser("run", help="solve case files and write their results")
    run.add_argument(
        "cases",
        nargs="+",
        metavar="CASE",
        help="a YAML case file, a pattern such as '*.yaml', or the name of a shipped case (see tetlux list)",
    )
    run.add_argument(
        "--out", type=Path, default=Path("results"), metavar="DIR", help="folder of all results; default: results"
    )
    run.add_argument(
        "--jobs", type=int, metavar="N", help="worker processes; default: the cores that this process may use"
    )
    run.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address or file of a Dask scheduler, whose workers do the work (pip install 'tetlux[cluster]')",
    )
    run.add_argument("--resume", action="store_true", help="keep the runs that are finished in DIR, by their content")
    how = run.add_mutually_exclusive_group()
    how.add_argument("--quiet", action="store_true", help="print nothing but what failed")
    how.add_argument("--verbose", action="store_true", help="print each stage of every run, also of many")
    run.add_argument("--no-cache", action="store_true", help="do not use cached meshes of earlier runs, and cache none")
    run.set_defaults(command=does.run)

    _add_inspections(commands)
    _add_helpers(commands)
    _add_measurements(commands)
    return parser


def _add_inspections(commands: "argparse._SubParsersAction[_Parser]") -> None:
    """Add the commands that look at cases and results."""
    check = commands.add_parser("check", help="check case files and the files they name, without solving")
    check.add_argument("cases", nargs="+", metavar="CASE", help="a YAML case file, a pattern, or a shipped case")
    check.add_argument("--plan", action="store_true", help="print how the runs would be grouped and shared, as JSON")
    check.set_defaults(command=does.check)

    plan = commands.add_parser("plan", help="print which model fits each case, what each model costs, and why")
    plan.add_argument("cases", nargs="+", metavar="CASE", help="a YAML case file, a pattern, or a shipped case")
    plan.set_defaults(command=does.plan)

    listing = commands.add_parser("list", help="list the cases that ship with tetlux")
    listing.set_defaults(command=does.list_shipped)

    show = commands.add_parser("show", help="print a case file, for instance a shipped one to start from")
    show.add_argument("case", metavar="CASE", help="a YAML case file, or the name of a shipped one")
    show.set_defaults(command=does.show)

    view = commands.add_parser("view", help="open the viewer of a finished run in the web browser")
    view.add_argument("result", type=Path, metavar="RESULT", help="the folder of the run, in which viewer.html is")
    view.set_defaults(command=does.view)

    compare = commands.add_parser("compare", help="compare two finished runs: figures, and a picture side by side")
    compare.add_argument("first", type=Path, metavar="A", help="the folder of a run")
    compare.add_argument("second", type=Path, metavar="B", help="the folder of another run")
    compare.add_argument("--field", default="exitance", help="an array of surface.ply; default: exitance")
    compare.add_argument(
        "--out", type=Path, default=Path("compare.png"), metavar="PNG", help="the picture; default: compare.png"
    )
    compare.set_defaults(command=does.compare)

    film = commands.add_parser("film", help="show finished runs one after the other, such as those of a sweep")
    film.add_argument("results", nargs="+", type=Path, metavar="RESULT", help="the folder of a run, or that of a sweep")
    film.add_argument("--field", default="exitance", help="an array of surface.ply; default: exitance")
    film.add_argument(
        "--out", type=Path, default=Path("film.gif"), metavar="FILE", help="a .gif or .webp; default: film.gif"
    )
    film.set_defaults(command=does.film)


def _add_helpers(commands: "argparse._SubParsersAction[_Parser]") -> None:
    """Add the commands that help to write cases and to report trouble."""
    new = commands.add_parser("new", help="write a commented case file to start from")
    new.add_argument("name", metavar="NAME", help="name of the case: NAME.yaml is written")
    new.add_argument("surface", nargs="?", metavar="SURFACE", help="a surface file, which becomes the body")
    new.set_defaults(command=does.new)

    schema = commands.add_parser("schema", help="print the JSON Schema of the case file")
    schema.set_defaults(command=does.schema)

    doctor = commands.add_parser("doctor", help="print what this machine has, for reports of errors")
    doctor.set_defaults(command=does.doctor)


def _add_measurements(commands: "argparse._SubParsersAction[_Parser]") -> None:
    """Add the commands that measure the solver itself."""
    chart = commands.add_parser("chart", help="compare methods by error, seconds and unknowns")
    chart.add_argument("cases", nargs="*", metavar="CASE", help="default: the shipped cases of the chart in README")
    chart.add_argument(
        "--out", type=Path, default=Path("chart"), metavar="DIR", help="folder of the chart; default: chart"
    )
    chart.add_argument(
        "--readings", action="store_true", help="compare what detectors read, not the exitance over the surface"
    )
    chart.add_argument("--quick", action="store_true", help="run a few coarse resolutions of each method only")
    chart.set_defaults(command=does.chart)

    stress = commands.add_parser("stress", help="run the solver at extreme values and map where it fails")
    stress.add_argument(
        "--out", type=Path, default=Path("stress"), metavar="DIR", help="folder of the map; default: stress"
    )
    stress.add_argument("--quick", action="store_true", help="run a few values on each axis only")
    stress.set_defaults(command=does.stress)


if __name__ == "__main__":
    sys.exit(main())

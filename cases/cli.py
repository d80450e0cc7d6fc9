"""The command line: ``tetlux run``, ``tetlux check``, ``tetlux list`` and others."""

import argparse
import re
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

# What takes half a second to import, numpy and all that needs it, is imported where it is used: --help, list and show
# answer at once, and Ctrl-C may come at any moment.


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns
    -------
    int
        0 if all went well, 1 if some case failed, 2 if the request itself is wrong, 130 if it was interrupted.
    """
    try:
        _be_interrupted_by_signals()
        return _main(arguments)
    except KeyboardInterrupt:
        return _report("interrupted; finished cases are kept.", 130)


def _main(arguments: Sequence[str] | None) -> int:
    options = _parser().parse_args(arguments)
    try:
        code = int(options.command(options))
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        # Most likely of what is printed to; but whoever reads it may have had enough of it.
        return 1 if isinstance(error, BrokenPipeError) else _report(f"stopped: {error}; finished cases are kept.", 1)
    except Exception as error:
        return _failed(error)
    return code


def _failed(error: Exception) -> int:
    """The exit code of an error that has a sentence for the user; any other is raised again."""
    from tetlux.meshing.errors import TetluxError, memory_ran_out  # noqa: PLC0415

    if isinstance(error, TetluxError):
        return _report(str(error), 2)
    if isinstance(error, MemoryError | RuntimeError) and memory_ran_out(error):
        return _report("memory ran out; finished cases are kept.", 1)
    raise error


def _report(sentence: str, code: int) -> int:
    """An exit code, with a sentence that says why."""
    print(f"tetlux: {sentence}", file=sys.stderr)
    return code


def _be_interrupted_by_signals() -> None:
    """Let a scheduler's and a closing terminal's signal end a run as Ctrl-C does, with nothing left behind."""
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
            # nohup has one of them ignored.
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, signal.default_int_handler)


class _Parser(argparse.ArgumentParser):
    """One that says which command a word that is none was probably meant to be."""

    def error(self, message: str) -> NoReturn:
        wrong = re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message)
        if wrong:
            from tetlux.cases.hints import did_you_mean  # noqa: PLC0415

            commands = re.findall(r"[\w-]+", wrong[2])
            hint = did_you_mean(wrong[1], commands)
            message = f'there is no command "{wrong[1]}"; {hint}the commands are {", ".join(commands)}.'
        super().error(message)


class _Version(argparse.Action):
    """Prints the version, which is looked up only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version  # noqa: PLC0415

        print(f"tetlux {version('tetlux')}")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="tetlux", description="Light diffusing through any shape, by tetrahedral finite elements.")
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    run = commands.add_parser("run", help="solve case files and write their results")
    run.add_argument(
        "cases",
        nargs="+",
        metavar="CASE",
        help="a YAML case file, or the name of one that ships (see tetlux list)",
    )
    run.add_argument("--out", type=Path, default=Path("results"), metavar="DIR", help="default: results")
    run.add_argument("--no-cache", action="store_true", help="neither use nor keep meshes of earlier runs")
    run.set_defaults(command=_run)

    check = commands.add_parser("check", help="check case files and the surfaces they name, without solving")
    check.add_argument("cases", nargs="+", metavar="CASE")
    check.set_defaults(command=_check)

    listing = commands.add_parser("list", help="list the cases that ship")
    listing.set_defaults(command=_list)

    show = commands.add_parser("show", help="print a case file, such as one that ships, to start from")
    show.add_argument("case", metavar="CASE")
    show.set_defaults(command=_show)

    chart = commands.add_parser("chart", help="measure methods against each other: error, seconds, unknowns")
    chart.add_argument("cases", nargs="*", metavar="CASE", help="default: slab sphere torus hare, which ship")
    chart.add_argument("--out", type=Path, default=Path("chart"), metavar="DIR", help="default: chart")
    chart.add_argument("--quick", action="store_true", help="a few coarse runs of each method only")
    chart.set_defaults(command=_chart)

    stress = commands.add_parser("stress", help="drive the solver to its edges and map what breaks")
    stress.add_argument("--out", type=Path, default=Path("stress"), metavar="DIR", help="default: stress")
    stress.add_argument("--quick", action="store_true", help="few values on each axis")
    stress.set_defaults(command=_stress)

    schema = commands.add_parser("schema", help="print the JSON Schema of the case file")
    schema.set_defaults(command=_schema)
    return parser


def _run(options: argparse.Namespace) -> int:
    from tetlux.cases.batch import load_all, run_all  # noqa: PLC0415

    return run_all(load_all(options.cases), options.out, cache=not options.no_cache)


def _check(options: argparse.Namespace) -> int:
    from tetlux.cases.batch import check_all  # noqa: PLC0415

    return check_all(options.cases)


def _list(_: argparse.Namespace) -> int:
    from tetlux.cases.shipped import shipped_cases  # noqa: PLC0415

    for name, sentence in shipped_cases().items():
        print(f"{name:<10} {sentence}")
    return 0


def _show(options: argparse.Namespace) -> int:
    from tetlux.cases.shipped import case_text  # noqa: PLC0415

    print(case_text(options.case), end="")
    return 0


def _chart(options: argparse.Namespace) -> int:
    from tetlux.cases.chart.command import DEFAULT_CASES, chart  # noqa: PLC0415

    return chart(options.cases or DEFAULT_CASES, options.out, quick=options.quick)


def _stress(options: argparse.Namespace) -> int:
    from tetlux.cases.stress.command import stress  # noqa: PLC0415

    return stress(options.out, quick=options.quick)


def _schema(_: argparse.Namespace) -> int:
    import json  # noqa: PLC0415

    from tetlux.cases.file.schema.case import CaseSpec  # noqa: PLC0415

    print(json.dumps(CaseSpec.model_json_schema(), indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())

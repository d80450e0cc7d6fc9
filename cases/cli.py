"""The command line: ``tetlux run``, ``tetlux check``, ``tetlux list`` and others."""

import argparse
import re
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from tetlux.cases.start import mark_start

if TYPE_CHECKING:
    from tetlux.cases.batch.events import Listener
    from tetlux.cases.batch.launch import Launcher

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
        _treat_signals_as_interrupts()
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
        # Most likely of standard output. A broken pipe only means that its reader, such as head, has ended.
        return 1 if isinstance(error, BrokenPipeError) else _report(f"stopped: {error}; finished cases are kept.", 1)
    except Exception as error:
        return _exit_code_of(error)
    return code


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


def _treat_signals_as_interrupts() -> None:
    """Make SIGTERM (a scheduler) and SIGHUP (a closing terminal) end a run as Ctrl-C does, with clean-up."""
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
            # nohup ignores SIGHUP, which must stay so.
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, signal.default_int_handler)


class _Parser(argparse.ArgumentParser):
    """A parser that suggests a command for a misspelt one."""

    def error(self, message: str) -> NoReturn:
        invalid = re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message)
        if invalid:
            from tetlux.cases.hints import did_you_mean  # noqa: PLC0415

            commands = re.findall(r"[\w-]+", invalid[2])
            hint = did_you_mean(invalid[1], commands)
            message = f'there is no command "{invalid[1]}"; {hint}the commands are {", ".join(commands)}.'
        super().error(message)


class _Version(argparse.Action):
    """Prints the version, and looks it up only when asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version  # noqa: PLC0415

        print(f"tetlux {version('tetlux')}")
        parser.exit()


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
    run.add_argument("--quiet", action="store_true", help="print nothing but what failed")
    run.add_argument("--no-cache", action="store_true", help="do not use cached meshes of earlier runs, and cache none")
    run.set_defaults(command=_run)

    _add_inspections(commands)
    _add_measurements(commands)
    return parser


def _add_inspections(commands: "argparse._SubParsersAction[_Parser]") -> None:
    """Add the commands that look at cases and results."""
    check = commands.add_parser("check", help="check case files and the files they name, without solving")
    check.add_argument("cases", nargs="+", metavar="CASE", help="a YAML case file, a pattern, or a shipped case")
    check.add_argument("--plan", action="store_true", help="print how the runs would be grouped and shared, as JSON")
    check.set_defaults(command=_check)

    plan = commands.add_parser("plan", help="print which model fits each case, what each model costs, and why")
    plan.add_argument("cases", nargs="+", metavar="CASE", help="a YAML case file, a pattern, or a shipped case")
    plan.set_defaults(command=_plan)

    listing = commands.add_parser("list", help="list the cases that ship with tetlux")
    listing.set_defaults(command=_list)

    show = commands.add_parser("show", help="print a case file, for instance a shipped one to start from")
    show.add_argument("case", metavar="CASE", help="a YAML case file, or the name of a shipped one")
    show.set_defaults(command=_show)

    view = commands.add_parser("view", help="open the viewer of a finished run in the web browser")
    view.add_argument("result", type=Path, metavar="RESULT", help="the folder of the run, in which viewer.html is")
    view.set_defaults(command=_view)

    schema = commands.add_parser("schema", help="print the JSON Schema of the case file")
    schema.set_defaults(command=_schema)


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
    chart.set_defaults(command=_chart)

    stress = commands.add_parser("stress", help="run the solver at extreme values and map where it fails")
    stress.add_argument(
        "--out", type=Path, default=Path("stress"), metavar="DIR", help="folder of the map; default: stress"
    )
    stress.add_argument("--quick", action="store_true", help="run a few values on each axis only")
    stress.set_defaults(command=_stress)


def _run(options: argparse.Namespace) -> int:
    from tetlux.cases.batch.launch import Launcher, seem_many  # noqa: PLC0415
    from tetlux.meshing.host.blocks import CORES  # noqa: PLC0415

    with Launcher() as launcher:
        starts_early = options.scheduler is None and not options.resume
        if starts_early and seem_many(options.cases):
            # Its libraries load while those of this process do.
            launcher.start_first(options.jobs or CORES)
        return _run_with(launcher, options, starts_early=starts_early)


def _run_with(launcher: "Launcher", options: argparse.Namespace, *, starts_early: bool) -> int:
    from tetlux.cases.batch.display.displays import choose_display  # noqa: PLC0415
    from tetlux.cases.batch.display.logs import RunLogs  # noqa: PLC0415
    from tetlux.cases.batch.engine import run_batch, worker_count  # noqa: PLC0415
    from tetlux.cases.batch.requests import load_all  # noqa: PLC0415
    from tetlux.cases.results.batch_tables import BatchTables, results_file  # noqa: PLC0415
    from tetlux.meshing.errors import RunError  # noqa: PLC0415

    def expect(runs: int) -> None:
        if starts_early:
            launcher.prepare(worker_count(options.jobs, runs))

    cases = load_all(options.cases, expect)
    listeners: list[Listener] = [choose_display(len(cases), quiet=options.quiet)]
    # The summary of a single run says all that tables would, unless there are tables that it belongs into.
    if len(cases) > 1 or results_file(options.out).path.exists():
        listeners += [RunLogs(), BatchTables()]
    try:
        ended = run_batch(
            cases,
            options.out,
            jobs=options.jobs,
            resume=options.resume,
            scheduler=options.scheduler,
            cache=not options.no_cache,
            listeners=listeners,
            launcher=launcher,
        )
    except RunError as error:
        return _report(str(error), 1)
    return 1 if ended.failed or ended.left else 0


def _check(options: argparse.Namespace) -> int:
    from tetlux.cases.batch.requests import check_all  # noqa: PLC0415

    return check_all(options.cases, plan=options.plan)


def _plan(options: argparse.Namespace) -> int:
    from tetlux.cases.batch.requests import print_models  # noqa: PLC0415

    return print_models(options.cases)


def _list(_: argparse.Namespace) -> int:
    from tetlux.cases.shipped import shipped_cases  # noqa: PLC0415

    for name, sentence in shipped_cases().items():
        print(f"{name:<10} {sentence}")
    return 0


def _show(options: argparse.Namespace) -> int:
    from tetlux.cases.shipped import case_text  # noqa: PLC0415

    print(case_text(options.case), end="")
    return 0


def _view(options: argparse.Namespace) -> int:
    from tetlux.cases.viewer.view import view  # noqa: PLC0415

    print(f"opened {view(options.result)}")
    return 0


def _chart(options: argparse.Namespace) -> int:
    from tetlux.cases.chart.command import chart  # noqa: PLC0415

    return chart(options.cases, options.out, readings=options.readings, quick=options.quick)


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

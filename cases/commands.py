"""What each command of the command line does; it returns the exit code.

Modules that need numpy take half a second to import, so they are imported where they are used: list and show then
answer at once.
"""

import argparse
import sys
from typing import TYPE_CHECKING

from tetlux.cases.start import first_imports

if TYPE_CHECKING:
    from tetlux.cases.batch.events import Listener
    from tetlux.cases.batch.launch import Launcher


def run(options: argparse.Namespace) -> int:
    """Solve cases and write their results."""
    from tetlux.cases.batch.launch import CORES, Launcher, seem_many  # noqa: PLC0415

    with Launcher() as launcher:
        starts_early = options.scheduler is None and not options.resume
        if starts_early and seem_many(options.cases):
            # Its libraries load while those of this process do.
            launcher.start_first(options.jobs or CORES)
        return _run_with(launcher, options, starts_early=starts_early)


def _run_with(launcher: "Launcher", options: argparse.Namespace, *, starts_early: bool) -> int:
    with first_imports():
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
    listeners: list[Listener] = [choose_display(len(cases), quiet=options.quiet, verbose=options.verbose)]
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
        print(f"tetlux: {error}", file=sys.stderr)
        return 1
    return 1 if ended.failed or ended.left else 0


def check(options: argparse.Namespace) -> int:
    """Check cases without solving."""
    with first_imports():
        from tetlux.cases.batch.requests import check_all  # noqa: PLC0415

    return check_all(options.cases, plan=options.plan)


def plan(options: argparse.Namespace) -> int:
    """Print which model fits each case."""
    with first_imports():
        from tetlux.cases.batch.requests import print_models  # noqa: PLC0415

    return print_models(options.cases)


def list_shipped(_: argparse.Namespace) -> int:
    """List the shipped cases."""
    from tetlux.cases.shipped import shipped_cases  # noqa: PLC0415

    for name, sentence in shipped_cases().items():
        print(f"{name:<10} {sentence}")
    return 0


def show(options: argparse.Namespace) -> int:
    """Print a case file."""
    from tetlux.cases.shipped import case_text  # noqa: PLC0415

    print(case_text(options.case), end="")
    return 0


def view(options: argparse.Namespace) -> int:
    """Open the viewer of a run."""
    from tetlux.cases.viewer.view import open_viewer  # noqa: PLC0415

    print(f"opened {open_viewer(options.result)}")
    return 0


def chart(options: argparse.Namespace) -> int:
    """Compare methods."""
    from tetlux.cases.chart.command import chart as draw_chart  # noqa: PLC0415

    return draw_chart(options.cases, options.out, readings=options.readings, quick=options.quick)


def stress(options: argparse.Namespace) -> int:
    """Map where the solver fails."""
    from tetlux.cases.stress.command import stress as map_limits  # noqa: PLC0415

    return map_limits(options.out, quick=options.quick)


def schema(_: argparse.Namespace) -> int:
    """Print the JSON Schema of the case file."""
    import json  # noqa: PLC0415

    from tetlux.cases.file.schema.case import CaseSpec  # noqa: PLC0415

    print(json.dumps(CaseSpec.model_json_schema(), indent=2))
    return 0


def compare(options: argparse.Namespace) -> int:
    """Compare two finished runs."""
    from tetlux.cases.results.compare import compare_results  # noqa: PLC0415

    for line in compare_results(options.first, options.second, options.out, options.field):
        print(line)
    return 0


def film(options: argparse.Namespace) -> int:
    """Show finished runs one after the other."""
    from tetlux.cases.results.film import film_results  # noqa: PLC0415

    count = film_results(options.results, options.out, options.field)
    print(f"{count} runs, written to {options.out}")
    return 0


def new(options: argparse.Namespace) -> int:
    """Write a commented case file."""
    from tetlux.cases.new import write_new_case  # noqa: PLC0415

    path = write_new_case(options.name, options.surface)
    print(f"wrote {path}; change it, then: tetlux run {path}")
    return 0


def doctor(_: argparse.Namespace) -> int:
    """Describe this machine and what is installed."""
    from tetlux.cases.doctor import describe_machine  # noqa: PLC0415

    for name, text in describe_machine():
        print(f"{name:<12} {text}", flush=True)
    return 0

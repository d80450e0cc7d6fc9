"""The stress map in words: by panel and method the worst figures, what breaks where, and what is refused."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence

from tetlux.cases.stress.measure import Figures
from tetlux.cases.stress.panels import Axis, Panel, Value
from tetlux.cases.stress.rules import broken, is_warned, violations
from tetlux.cases.stress.runs import Run

HEADS = (
    "panel",
    "method",
    "ran",
    "refused",
    "failed",
    "warned",
    "lowest fluence",
    "overshoot",
    "ledger",
    "residual",
    "iterations",
    "largest error",
    "seconds",
    "violations",
)


def in_words(runs: Sequence[Run]) -> str:
    """The table and what is to be read with it, as Markdown."""
    lines = [f"| {' | '.join(HEADS)} |", "|---|---|" + "---:|" * (len(HEADS) - 2)]
    groups = list(_groups(runs))
    lines += [f"| {' | '.join(_row(group))} |" for group in groups]
    lines += [
        "",
        "Lowest fluence is by the largest, where the source has no first moment; overshoot is over the bound of the "
        "maximum principle; the ledger is by the incident power; largest error is the relative L2 error of the "
        "exitance against a closed form; iterations of 0 are direct solutions.",
        "",
        "## Violations",
        "",
    ]
    found = [f"* {_place(run)}: {rule}, {figure}." for run in runs for rule, figure in violations(run).items()]
    lines += found or ["None."]
    lines += ["", "## What breaks where", ""]
    breaking = [line for group in groups for line in _ranges(group)]
    lines += breaking or ["Nothing."]
    lines += ["", "## Refused", ""]
    refused = Counter((run.panel.name, run.message) for run in runs if run.outcome == "refused")
    lines += [f"* {panel}, {_times(count)}: {message}" for (panel, message), count in refused.items()] or ["Nothing."]
    return "\n".join(lines) + "\n"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _groups(runs: Sequence[Run]) -> Iterator[list[Run]]:
    """Runs of one panel and one method."""
    for name in dict.fromkeys(run.panel.name for run in runs):
        here = [run for run in runs if run.panel.name == name]
        for method in dict.fromkeys(run.method.name for run in here):
            yield [run for run in here if run.method.name == method]


def _row(group: list[Run]) -> list[str]:
    outcomes = Counter(run.outcome for run in group)
    figures = [run.figures for run in group if run.figures is not None]

    def most(value: Callable[[Figures], float | None], form: str = ".1e") -> str:
        values = [each for one in figures if (each := value(one)) is not None]
        return format(max(values), form) if values else ""

    lowest = [one.lowest for one in figures if not one.dips]
    errors = [one.error for one in figures if one.error is not None]
    return [
        group[0].panel.name,
        group[0].method.name,
        *(str(outcomes[outcome]) for outcome in ("ran", "refused", "failed")),
        str(sum(map(is_warned, figures))),
        f"{min(lowest):.1e}" if lowest else "",
        most(lambda one: one.overshoot),
        most(lambda one: abs(one.ledger)),
        most(lambda one: one.residual),
        most(lambda one: one.iterations, "d"),
        f"{max(errors):.2g}" if errors else "",
        most(lambda one: one.seconds, ".1f"),
        str(sum(bool(violations(run)) for run in group)) if group[0].method.counts else "not counted",
    ]


def _ranges(group: list[Run]) -> Iterator[str]:
    """By rule: how many runs break it, and between which values of the axes."""
    rules = dict.fromkeys(rule for run in group for rule in broken(run))
    for rule in rules:
        here = [run for run in group if rule in broken(run)]
        panel: Panel = group[0].panel
        where = " and ".join(
            _range(axis, values)
            for axis, values in ((panel.x, [run.x for run in here]), (panel.y, [run.y for run in here]))
        )
        yield f"* {panel.name}, {group[0].method.name}: {rule} in {len(here)} of {len(group)}, at {where}."


def _range(axis: Axis, values: list[Value]) -> str:
    numbers = [value for value in values if not isinstance(value, str)]
    if not numbers:
        return ", ".join(dict.fromkeys(map(str, values)))
    low, high = min(numbers), max(numbers)
    return f"{axis.name} {low:g}" if low == high else f"{axis.name} {low:g} to {high:g}"


def _place(run: Run) -> str:
    """Where on the map a run is."""
    values = ((run.panel.x, run.x), (run.panel.y, run.y))
    where = ", ".join(_range(axis, [value]) for axis, value in values)
    return f"{run.panel.name}, {run.method.name}, at {where}"

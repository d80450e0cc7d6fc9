"""The stress map as text: the worst figures by panel and variant, broken rules, and refused scenarios."""

import statistics
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

from tetlux.cases.stress.measure import Diagnostics
from tetlux.cases.stress.panels import PLANNED, Axis, Panel, Value
from tetlux.cases.stress.rules import broken_rules, is_warned, violations
from tetlux.cases.stress.scenes.scenarios import TOLERANCE
from tetlux.cases.stress.trials import Trial

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


NOTE = (
    "Lowest fluence is relative to the largest, for sources without a first moment; overshoot is relative to the bound "
    "of the maximum principle, ledger to the incident power; largest error is the relative L2 error of the exitance "
    "against a closed form, of readings that of the worst; 0 iterations mean a direct solver."
)


def as_markdown(trials: Sequence[Trial]) -> str:
    """Write the whole report as Markdown."""
    groups = list(_groups(trials))
    lines = [f"| {' | '.join(HEADS)} |", "|---|---|" + "---:|" * (len(HEADS) - 2)]
    lines += [f"| {' | '.join(_row(group))} |" for group in groups]
    lines += ["", NOTE, "", "## What breaks where", ""]
    breaking = [line for group in groups for line in _ranges(group)]
    lines += breaking or ["Nothing."]
    lines += ["", "## Refused", ""]
    refused = Counter((trial.panel.name, trial.message) for trial in trials if trial.outcome == "refused")
    lines += [f"* {panel}, {_times(count)}: {message}" for (panel, message), count in refused.items()] or ["Nothing."]
    lines += _regret(trials)
    # Last, since the end of a long log is what its reader sees.
    lines += ["", "## Violations", ""]
    found = [f"* {_place(trial)}: {rule}, {figure}." for trial in trials for rule, figure in violations(trial).items()]
    lines += found or ["None."]
    return "\n".join(lines) + "\n"


def _regret(trials: Sequence[Trial]) -> list[str]:
    """The section on the regret of the plan: seconds of the model that it chose over those of the fastest."""
    planned = [trial for trial in trials if trial.variant == PLANNED and trial.diagnostics is not None]
    if not planned:
        return []
    regrets = []
    for trial in planned:
        scene = (trial.panel.name, trial.x, trial.y)
        met = [
            found.seconds
            for other in trials
            if (other.panel.name, other.x, other.y) == scene
            and (found := other.diagnostics) is not None
            and (other == trial or found.estimate <= TOLERANCE)
        ]
        assert trial.diagnostics is not None
        regrets.append((trial.diagnostics.seconds / min(met), trial))
    worst, where = max(regrets, key=lambda pair: pair[0])
    middle = statistics.median(regret for regret, _ in regrets)
    return [
        "",
        "## Regret of the plan",
        "",
        "Seconds of the model that the plan chose, planning and vain trials included, over those of the fastest model "
        f"within the tolerance: {middle:.2f} in the median of {len(regrets)}, {worst:.2f} in the worst "
        f"({_place(where)}).",
    ]


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _groups(trials: Sequence[Trial]) -> Iterator[list[Trial]]:
    """Group trials by panel and variant."""
    for name in dict.fromkeys(trial.panel.name for trial in trials):
        here = [trial for trial in trials if trial.panel.name == name]
        for variant in dict.fromkeys(trial.variant.name for trial in here):
            yield [trial for trial in here if trial.variant.name == variant]


def _row(group: list[Trial]) -> list[str]:
    outcomes = Counter(trial.outcome for trial in group)
    found = [trial.diagnostics for trial in group if trial.diagnostics is not None]

    def most(value: Callable[[Diagnostics], float | None], form: str = ".1e") -> str:
        values = [each for diagnostics in found if (each := value(diagnostics)) is not None]
        return format(max(values), form) if values else ""

    lowest = [each.lowest for each in found if each.lowest is not None and not each.may_be_negative]
    errors = [diagnostics.error for diagnostics in found if diagnostics.error is not None]
    return [
        group[0].panel.name,
        group[0].variant.name,
        *(str(outcomes[outcome]) for outcome in ("ran", "refused", "failed")),
        str(sum(map(is_warned, found))),
        f"{min(lowest):.1e}" if lowest else "",
        most(lambda d: d.overshoot),
        most(lambda d: None if d.ledger is None else abs(d.ledger)),
        most(lambda d: d.residual),
        most(lambda d: d.iterations, "d"),
        f"{max(errors):.2g}" if errors else "",
        most(lambda d: d.seconds, ".1f"),
        str(sum(bool(violations(trial)) for trial in group)) if group[0].variant.counts else "not counted",
    ]


def _ranges(group: list[Trial]) -> Iterator[str]:
    """Report for each rule how many trials break it, and the range of their axis values."""
    rules = dict.fromkeys(rule for trial in group for rule in broken_rules(trial))
    for rule in rules:
        here = [trial for trial in group if rule in broken_rules(trial)]
        panel: Panel = group[0].panel
        where = " and ".join(
            _range(axis, values)
            for axis, values in ((panel.x, [trial.x for trial in here]), (panel.y, [trial.y for trial in here]))
        )
        yield f"* {panel.name}, {group[0].variant.name}: {rule} in {len(here)} of {len(group)}, at {where}."


def _range(axis: Axis, values: list[Value]) -> str:
    numbers = [value for value in values if not isinstance(value, str)]
    if not numbers:
        return ", ".join(dict.fromkeys(map(str, values)))
    low, high = min(numbers), max(numbers)
    return f"{axis.name} {low:g}" if low == high else f"{axis.name} {low:g} to {high:g}"


def _place(trial: Trial) -> str:
    """Describe the position of a trial on the map."""
    values = ((trial.panel.x, trial.x), (trial.panel.y, trial.y))
    where = ", ".join(_range(axis, [value]) for axis, value in values)
    return f"{trial.panel.name}, {trial.variant.name}, at {where}"

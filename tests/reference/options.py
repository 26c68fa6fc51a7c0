"""The page of the plugin: options, fixtures, markers, outcome letters, exit statuses."""

from __future__ import annotations

import inspect
from types import ModuleType
from typing import get_args

from pytest_libero_max.evaluation.settings import OPTIONS
from pytest_libero_max.plugin import hooks, hookspec
from pytest_libero_max.report import exit_status
from pytest_libero_max.runs import progress
from pytest_libero_max.runs.setting import Group, Option
from tests.reference.docstrings import constants, description
from tests.reference.markdown import code, one_line, prose, table

EXAMPLE = """
def test_few_actions_are_stale(libero_max_case, libero_max_prefix, libero_max_inject, libero_max_policy):
    evidence = libero_max_inject()  # the world is where Base met the event; now the event happens
    assert evidence["operation"] == libero_max_case.event.change["operation"]
    assert len(libero_max_prefix.pending) < libero_max_policy.spec.query_interval
"""
"""A test module of a user."""


def page() -> str:
    """The text."""
    from pytest_libero_max.lab import ray  # tests of the core import this module as well

    options = "\n\n".join(
        f"## {group.capitalize()} options\n\n{_options(group)}" for group in get_args(Group)
    )
    fixtures = "\n\n".join(
        _fixture(name)
        for name in ("libero_max_case", *sorted(hooks.__all__))
        if name.startswith("libero_max_")
    )
    hooks_of_ours = "\n\n".join(
        f"**`{name}{inspect.signature(value)}`**. {prose(description(value))}".replace("'", "")
        for name, value in vars(hookspec).items()
        if name.startswith("pytest_libero_max_")
    )
    letters = table(
        ("Letter", "Outcome"),
        (
            *((code(letter), outcome) for outcome, letter in progress.LETTERS.items()),
            (code(progress.UNTRIGGERED), "the event never fired"),
            (code(progress.ERROR), "error: the pair could not be measured"),
        ),
    )
    statuses = table(
        ("Exit status", "Meaning"),
        ((item.value, one_line(item.text)) for item in constants(exit_status) if item.value.isdigit()),
    )
    return f"""# Options, fixtures, outcomes

Every option is also an ini key: `--libero-max-track` is `libero_max_track`. The command line wins over the
ini file, and the ini file over the default. The tables of pytest 9 (`[tool.pytest]`, `pytest.toml`) hold
numbers, true and false, and lists as such, and the parts of an option by name:
`libero_max_noise = {{sham = 0.2, floor = 4}}`, `libero_max_study = {{cadence = [2, 4]}}`.
With `PYTEST_DISABLE_PLUGIN_AUTOLOAD=1`, `pytest -p libero_max -p xdist` loads the plugin, and workers.

{options}

## Fixtures

{fixtures}

A test of your own has one item for each case of the track:

```python
{EXAMPLE.strip()}
```

```sh
pytest test_mine.py --libero-max-policy=adapter.py
```

## Hooks

{prose(description(hookspec))}

{hooks_of_ours}

## Outcomes

Each pair is one letter on the progress line and one sentence with `-v`.

{letters}

## On a Ray cluster

{_without_summary(ray)}

## Exit statuses

Those of pytest, and two of our own.

{statuses}
"""


def _options(group: str) -> str:
    own = [option for option in OPTIONS if option.group == group]
    assert all(option.key == option.flag.removeprefix("--").replace("-", "_") for option in own)
    return "\n\n".join(
        f"### {code(_usage(option))}\n\n{one_line(option.help)}.{_default(option)}" for option in own
    )


def _without_summary(module: ModuleType) -> str:
    return prose(description(module).split("\n\n", maxsplit=1)[1])


def _usage(option: Option) -> str:
    return option.flag if option.switch else f"{option.flag}={option.metavar}"


def _default(option: Option) -> str:
    return f"\n\nDefault: {code(option.default)}." if option.default else ""


def _fixture(name: str) -> str:
    if name == "libero_max_case":
        text = "The case. A test that asks for it, also through another fixture, has one item for each case."
    else:
        text = description(inspect.unwrap(getattr(hooks, name)))
    return f"**`{name}`**. {prose(text)}"

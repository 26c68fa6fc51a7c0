from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from tests.plugin.conftest import REACHER, tiny_manifest

Run = Callable[..., pytest.RunResult]


@pytest.mark.parametrize(
    ("arguments", "policy", "message"),
    [
        ([], "adaptor.py", "*there is no file 'adaptor.py'. Did you mean 'adapter.py'?"),
        ([], "adapter.py:Reachr", "*the adapter defines no 'Reachr'. Did you mean 'Reacher'?*"),
        ([], "ws://somewhere:8000", "*names a WebSocket, but not what is spoken over it*"),
        (
            ["--libero-max-horizon=4", "--libero-max-query-interval=5"],
            "adapter.py",
            "*query-interval=5 > *horizon=4*",
        ),
        (
            ["--libero-max-horizon=0"],
            "adapter.py",
            "*--libero-max-horizon='0': expected an integer of at least 1",
        ),
        (
            ["--libero-max-gate=base_sr > 80"],
            "adapter.py",
            "*--libero-max-gate='base_sr > 80' can never hold: * Write 80% or 0.8.",
        ),
        (["--libero-max-limit=all"], "adapter.py", "*--libero-max-limit='all': expected an integer*"),
        (["--libero-max-prefix=frok"], "adapter.py", "*--libero-max-prefix='frok'*Did you mean 'fork'?*"),
        (["--libero-max-strict=yes"], "adapter.py", "*--libero-max-strict='yes'*Known: regressions."),
        (
            ["--libero-max-traces=some"],
            "adapter.py",
            "*--libero-max-traces='some'*Known: all, changed, none, regressions.",
        ),
        (
            ["--libero-max-film=regresion"],
            "adapter.py",
            "*--libero-max-film='regresion'*Did you mean 'regressions'?*",
        ),
        (["--libero-max-substrate=liberro"], "adapter.py", "*--libero-max-substrate='liberro'*Known: *"),
        (
            ["--libero-max-track=smoke"],
            "adapter.py",
            "*--libero-max-track and --libero-max-manifest*give one*",
        ),
        (["--libero-max-output=adapter.py/results"], "adapter.py", "*Output folder*cannot be written to*"),
    ],
)
def test_bad_options_stop_the_run_before_it_begins(
    run: Run, arguments: list[str], policy: str, message: str
) -> None:
    result = run(*arguments, policy=policy)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: {message}"])


def test_an_unknown_track_names_the_known_ones(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(adapter=REACHER)
    result = pytester.runpytest_subprocess("--libero-max-policy=adapter.py", "--libero-max-track=smok")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: *'smok'*Did you mean 'smoke'?*"])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[: len(text) // 2], "*tiny.json: not a JSON document*"),
        (
            lambda text: text.replace("camera_shift", "camera_shaft"),
            "*'camera_shaft' is not an event. Did you mean 'camera_shift'*",
        ),
        (
            lambda text: text.replace('"policy_seed"', '"policy_sed"'),
            "*'policy_sed'. Did you mean 'policy_seed'*",
        ),
        (lambda text: json.dumps({**json.loads(text), "cases": []}), "*cases must be a non-empty list*"),
    ],
    ids=["torn", "unknown event", "missing field", "empty"],
)
def test_a_corrupt_manifest_stops_the_run(
    run: Run, pytester: pytest.Pytester, damage: Callable[[str], str], message: str
) -> None:
    (pytester.path / "tiny.json").write_text(damage(json.dumps(tiny_manifest())))
    result = run()
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: {message}"])


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return np.zeros((8, 6))", "*ActionError: *(8, 6)*"),
        ("return np.full((8, 7), np.nan)", "*ActionError: *must be finite*"),
        ("return np.zeros((2, 7))", "*ActionError: *returned 2 action*query_interval=4*"),
    ],
    ids=["shape", "not finite", "too few"],
)
def test_bad_actions_are_errors_of_the_pair(
    run: Run, pytester: pytest.Pytester, body: str, message: str
) -> None:
    head, _, _ = REACHER.partition("        action = np.zeros(7)")
    pytester.makepyfile(broken=f"{head}        {body}\n\npolicy = Reacher\n")
    result = run("-k", "camera_shift-v0", policy="broken.py")
    result.assert_outcomes(errors=1)
    assert result.ret == 11
    result.stdout.fnmatch_lines([message, "INCOMPLETE: 0 of 1 planned pairs*"])

from __future__ import annotations

from itertools import cycle

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.broken import named_of
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.formats import PValue
from pytest_libero_max.report.groups import FLOOR_NOTE
from pytest_libero_max.report.highlights import highlight_rows
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_texts import GIVEN_RESPONSE_NOTE
from pytest_libero_max.report.statements import STATEMENTS
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.stats.blocks import McNemar
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plan, record_of

PAIRS = plan()


def _records() -> list[PairRecord]:
    outcomes = cycle(
        [(True, True), (True, False), (True, True), (False, False), (True, False), (False, True)]
    )
    records = [record_of(pair, *outcome) for pair, outcome in zip(PAIRS, outcomes, strict=False)]
    return [record_of(PAIRS[0], False, False, **NEVER_TRIGGERED), *records[1:]]


COMPLETE = """\
scripted (10 actions per query, 5 executed) on embedded, 32 cases of track smoke (selection not
recorded):
32 of 32 planned pairs played
Scores on embedded scenes are not comparable with published ones.
Protocol class: world paused during inference (each answer is there at once).

Base success                    65.6% [46.8, 81.4]  21/32
Dynamic success                 46.9% [29.1, 65.3]  15/32
Paired change                   -18.8 pp [-43.7, +8.9]   McNemar p = 0.210
Paired change by task           n/a: too few tasks (1 of 30 needed)
Who succeeds                    P both 10   G only Dynamic 5   R only Base 11   N none 6
Base successes lost             52.4% [29.8, 74.3]  11/21   retained 71.4%
Event fired                     31/32   query after it 31/32
Stale actions until next query  mean 2.00   median 2

Event                  Pairs   Base  Dynamic          Change [95%]  Lost
illumination_switch        4  50.0%    25.0%  -25.0 [-90.4, +69.1]   2/2
camera_shift               4  75.0%    50.0%  -25.0 [-80.6, +52.7]   1/3
visual_theme_switch        4  50.0%    50.0%   +0.0 [-75.5, +75.5]   1/2
sensor_noise_onset         4  75.0%    50.0%  -25.0 [-90.4, +69.1]   2/3
target_relocation          4  75.0%    50.0%  -25.0 [-80.6, +52.7]   1/3
receptacle_relocation      4  50.0%    50.0%   +0.0 [-75.5, +75.5]   1/2
distractor_burst           4  75.0%    50.0%  -25.0 [-90.4, +69.1]   2/3
obstacle_insertion         4  75.0%    50.0%  -25.0 [-80.6, +52.7]   1/3

What broke: 11 of 21 Base successes lost
2 x illumination_switch
R   plus-spatial-t00-illumination_switch-v1
R   pro-spatial-t00-illumination_switch-v0
2 x sensor_noise_onset
R   plus-spatial-t00-sensor_noise_onset-v1
R   pro-spatial-t00-sensor_noise_onset-v0
2 x distractor_burst
R   plus-spatial-t00-distractor_burst-v1
R   pro-spatial-t00-distractor_burst-v0
1 x camera_shift
R   pro-spatial-t00-camera_shift-v1
1 x visual_theme_switch
R   plus-spatial-t00-visual_theme_switch-v0
1 x target_relocation
R   pro-spatial-t00-target_relocation-v1
The table of cases of report.html has 2 more, by outcome.

What was gained: 5 of 11 Base failures solved
1 x illumination_switch
G   pro-spatial-t00-illumination_switch-v1
1 x visual_theme_switch
G   plus-spatial-t00-visual_theme_switch-v1
1 x sensor_noise_onset
G   pro-spatial-t00-sensor_noise_onset-v1
1 x receptacle_relocation
G   plus-spatial-t00-receptacle_relocation-v1
1 x distractor_burst
G   pro-spatial-t00-distractor_burst-v1
These records hold no causes: an earlier version wrote them.
To see the first: pytest --libero-max-policy=scripted.py --libero-max-track=smoke \
--libero-max-substrate=embedded --libero-max-prefix=fork --libero-max-output=libero-max-replay \
--libero-max-film=all -k plus-spatial-t00-illumination_switch-v1
What the words mean: libero-max list words
Written: out/pairs.jsonl, out/report.json"""

INCOMPLETE = """\
INCOMPLETE: 30 of 32 planned pairs played, 1 invalid, 1 missing. No score.
scripted (10 actions per query, 5 executed) on embedded, 32 cases of track smoke (selection not
recorded):
30 of 32 planned pairs played
Scores on embedded scenes are not comparable with published ones.
Protocol class: world paused during inference (each answer is there at once).

Over 30 played pairs only:
Base success                    66.7% [47.2, 82.7]  20/30
Dynamic success                 50.0% [31.3, 68.7]  15/30
Paired change                   -16.7 pp [-42.8, +12.0]   McNemar p = 0.302
Paired change by task           n/a: too few tasks (1 of 30 needed)
Who succeeds                    P both 10   G only Dynamic 5   R only Base 10   N none 5
Base successes lost             50.0% [27.2, 72.8]  10/20   retained 75.0%
Event fired                     30/30   query after it 30/30
Stale actions until next query  mean 2.00   median 2

Event                   Pairs   Base  Dynamic          Change [95%]  Lost
illumination_switch    2 of 4  50.0%    50.0%   +0.0 [-97.5, +97.5]   1/1"""

NOTHING = """\
INCOMPLETE: 0 of 32 planned pairs played, 31 invalid, 1 missing. No score.
scripted.py on embedded, 32 cases of track smoke (selection not recorded):
0 of 32 planned pairs played
Scores on embedded scenes are not comparable with published ones.
Protocol class: world paused during inference (each answer is there at once).

No pair was played; there is nothing to report."""

ALL_ALIKE = """\
scripted (10 actions per query, 5 executed) on libero, 32 cases of track smoke (selection not
recorded):
32 of 32 planned pairs played
Protocol class: world paused during inference (each answer is there at once).

Not measurable: Base solves 0 of 32 pairs, so events have nothing to break; the event happened in 0
of 32 pairs: Dynamic equals Base.
Base success                    0.0% [0.0, 10.9]  0/32
Dynamic success                 0.0% [0.0, 10.9]  0/32
Paired change                   Not measurable
Who succeeds                    P both 0   G only Dynamic 0   R only Base 0   N none 32
Event fired                     0/32   query after it 0/32
Stale actions until next query  mean n/a   median n/a

Event                    Pairs  Base  Dynamic         Change [95%]  Lost
illumination_switch *        4  0.0%     0.0%  +0.0 [-60.2, +60.2]   0/0"""


def _text(records: list[PairRecord], *paths: str, provenance: Json = PROVENANCE) -> str:
    return "\n".join(summary_lines(build_report(records, [], PAIRS, provenance), paths))


def test_a_complete_run() -> None:
    assert _text(_records(), "out/pairs.jsonl", "out/report.json") == COMPLETE


def test_an_incomplete_run_says_so_first() -> None:
    report = build_report(_records()[2:], [error_of(PAIRS[0])], PAIRS, PROVENANCE)
    text = "\n".join(summary_lines(report))
    assert text.startswith(INCOMPLETE)
    assert markdown(report).splitlines()[2].startswith("**INCOMPLETE: 30 of 32")


def test_a_run_in_which_nothing_could_be_played() -> None:
    report = build_report([], [error_of(pair) for pair in PAIRS[1:]], PAIRS, PROVENANCE)
    assert "\n".join(summary_lines(report)) == NOTHING
    markdown(report)


def test_without_denominators_no_number_is_invented() -> None:
    records = [record_of(pair, False, False, **NEVER_TRIGGERED) for pair in PAIRS]
    text = _text(records, provenance={**PROVENANCE, "substrate": {"name": "libero"}})
    assert text.startswith(ALL_ALIKE)
    assert f"\n{FLOOR_NOTE}\n" in text


def test_the_summary_fits_a_terminal() -> None:
    pairs = plan(per_cell=32)
    records = [record_of(pair, index % 3 > 0, index % 2 > 0) for index, pair in enumerate(pairs)]
    lines = summary_lines(build_report(records[:-9], [], pairs, PROVENANCE))
    assert len(lines) <= 31 + 2 * 23  # twenty lines of pairs lost, as many of pairs gained
    assert max(len(line) for line in lines if ": pytest " not in line) <= 100


def test_the_command_that_shows_is_that_of_what_was_kept() -> None:
    report = build_report(_records(), [], PAIRS, PROVENANCE)
    name = report.changed_pairs[0].item_id
    films = {name: f"out/films/{name}--base-dynamic.webp"}
    filmed = summary_lines(report, films=films, show="libero-max view out")
    assert [line.split()[:5] for line in filmed if "libero-max view" in line] == [
        ["Films:", "out/films;", "libero-max", "view", "out"]
    ]
    traced = summary_lines(report, show="libero-max view out")
    assert any("see them: libero-max view out" in line for line in traced)
    (nothing,) = (line for line in summary_lines(report) if "see the first: pytest " in line)
    assert "--libero-max-film=all" in nothing
    assert nothing.endswith(f"-k {named_of(report.changed_pairs, 1)[0]}")


def test_a_p_value_is_never_printed_as_zero() -> None:
    assert PValue().long(McNemar(regressions=1, gains=1, p_value=0.25, log10_p_value=-0.602)) == "p = 0.250"
    assert (
        PValue().long(McNemar(regressions=1, gains=1, p_value=0.0, log10_p_value=-470.25)) == "p = 5.6e-471"
    )
    assert PValue().long(McNemar(regressions=1, gains=1, p_value=None, log10_p_value=None)) == "n/a"


def test_markdown_has_a_table_per_breakdown() -> None:
    text = markdown(build_report(_records(), [], PAIRS, PROVENANCE))
    assert text.startswith("# " + " ".join(COMPLETE.split(":\n")[0].split()) + "\n")
    assert "| camera_shift | 4 of 4 | 75.0% [19.4, 99.4]  3/4 |" in text
    for title in ("Event", "Family", "Suite", "Source", "Source category", "Severity", "Difficulty"):
        assert f"## {title}\n\n| {title} | Pairs played |" in text


def test_markdown_carries_every_statement_whatever_was_played() -> None:
    for records in ([], _records()):
        text = markdown(build_report(records, [], PAIRS, PROVENANCE))
        for statement in STATEMENTS.values():
            assert f"- {statement}\n" in text


def test_markdown_has_averages_extremes_and_results_given_a_response() -> None:
    report = build_report(_records(), [], PAIRS, PROVENANCE)
    text = markdown(report)
    for row in highlight_rows(report):
        assert f"| {' | '.join(row)} |" in text
    assert f"{GIVEN_RESPONSE_NOTE}\n\n| Event | Base success |" in text

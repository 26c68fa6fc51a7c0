"""The files of a comparison: JSON, Markdown, HTML and figures."""

from __future__ import annotations

from html import escape
from pathlib import Path

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.compare_figures import COMPARISON_FIGURES
from pytest_libero_max.report.compare_text import result_lines, with_short_names
from pytest_libero_max.report.files import make_folder, report_json, write_drawings, write_text
from pytest_libero_max.report.statements import LIMITS_TITLE

_STYLE = (
    "body{font:15px/1.5 system-ui,sans-serif;color:#1f2933;max-width:66rem;margin:2rem auto;padding:0 1rem}"
)
_CAPTIONS = {
    "event-changes": "Paired change by event. A dot is a run; the line is the range over the runs, the box "
    "reaches from the lower to the upper quartile, and the bar in it is the median.",
    "outcome-shares": "Outcomes of the pairs (Base, Dynamic) of every run, as shares of the common cases.",
}


def write_comparison(comparison: Json, folder: Path) -> list[Path]:
    """Write ``comparison.json``, ``comparison.md``, ``comparison.html`` and the figures.

    Args:
        comparison: What :func:`~pytest_libero_max.report.compare.compare_runs` returned.
        folder: Made where it is missing.

    Returns:
        The files. The figures are SVG, and PNG as well where the extra ``figures`` is installed.

    Raises:
        ReportError: They cannot be written.
    """
    files = {
        "comparison.json": report_json(comparison),
        "comparison.md": comparison_markdown(comparison),
        "comparison.html": comparison_html(comparison),
    }
    make_folder(folder)
    for name, content in files.items():
        write_text(folder / name, content)
    return [*(folder / name for name in files), *write_drawings(_drawn(comparison), folder)]


def comparison_markdown(comparison: Json) -> str:
    """A comparison as Markdown, with the figures beside it."""
    parts = [f"# {_title(comparison)}", "```text\n" + "\n".join(result_lines(comparison)) + "\n```"]
    parts += [f"![{caption}]({stem}.svg)\n\n{caption}" for stem, caption in _CAPTIONS.items()]
    parts += [f"## {LIMITS_TITLE}", "\n".join(f"- {text}" for text in comparison["statements"].values())]
    return "\n\n".join(parts) + "\n"


def comparison_html(comparison: Json) -> str:
    """A comparison as one page that needs no network and no script."""
    title = escape(_title(comparison))
    figures = "".join(
        f"<figure>{svg}<figcaption>{escape(_CAPTIONS[stem])}</figcaption></figure>"
        for stem, svg in _drawn(comparison).items()
    )
    limits = "".join(f"<li>{escape(text)}</li>" for text in comparison["statements"].values())
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        f"<title>{title}</title><style>{_STYLE}</style></head>\n<body>\n<h1>{title}</h1>\n"
        f"<pre>{escape(chr(10).join(result_lines(comparison)))}</pre>\n{figures}\n"
        f"<h2>{LIMITS_TITLE}</h2><ul>{limits}</ul>\n</body></html>\n"
    )


def _title(comparison: Json) -> str:
    return f"Comparison of {len(comparison['runs'])} runs on {comparison['pairs']['common']} common cases"


def _drawn(comparison: Json) -> dict[str, str]:
    shown = with_short_names({**comparison, "flips": []})
    return {stem: draw(shown) for stem, draw in COMPARISON_FIGURES.items()}

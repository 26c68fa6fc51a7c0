"""``libero-max view``: the page of a run in the browser."""

from __future__ import annotations

import argparse
import io
import re
import webbrowser
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, BinaryIO

from pytest_libero_max.cli.arguments import PORT, Commands, option, switch
from pytest_libero_max.cli.report import rewrite
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import ReportError, counted
from pytest_libero_max.runs.media import MOST_FILMS, films_in, traced_in

_PAGE = "report.html"
_RANGE = re.compile(r"bytes=(\d+)-(\d*)")


def add_command(commands: Commands) -> None:
    """Add ``view`` to the parser."""
    view = commands.add_parser(
        "view",
        help="Show the page of a run in the browser, with its films",
        description="Serves the folder on this machine alone, at an address that is printed, until Ctrl-C. "
        "What is missing is made first: films of changed pairs that have traces (Ctrl-C leaves them out), "
        "and the page.",
    )
    view.add_argument("folder", type=Path, metavar="RUN", help="Folder of the run")
    option(
        view,
        "--cases TRACK|MANIFEST",
        "The cases of a run whose films are made, if it has a manifest",
        dest="case_set",
    )
    option(view, "--port PORT", "Default: one that is free", type=PORT, default=0)
    switch(view, "--no-browser", "Print the address alone")
    view.set_defaults(run=_view)


def _view(options: argparse.Namespace) -> int:
    folder: Path = options.folder
    _make_films(folder, options.case_set)
    if not _page_shows_all(folder):
        rewrite(folder)
    try:
        server = ThreadingHTTPServer(("127.0.0.1", options.port), partial(_Files, directory=str(folder)))
    except OSError as error:
        raise ReportError(
            f"--port={options.port} cannot be used: {error.strerror}. Choose another."
        ) from None
    address = f"http://127.0.0.1:{server.server_port}/{_PAGE}"
    say([f"{address} (Ctrl-C ends it)", _films_text(folder)])
    if not options.no_browser:
        webbrowser.open(address)
    with server, suppress(KeyboardInterrupt):
        server.serve_forever()
    return 0


def _make_films(folder: Path, case_set: str | None) -> None:
    """Film the named pairs that the run has traces of, as many as a run films at its end."""
    from pytest_libero_max.cli import main
    from pytest_libero_max.report.broken import to_look_at
    from pytest_libero_max.report.writers.report_files import report_of
    from pytest_libero_max.runs.store import read_pairs

    missing = traced_in(folder) - films_in(folder).keys()
    if not missing:
        return
    named = to_look_at(report_of(read_pairs(folder)), MOST_FILMS)
    names = [name for name in named if name in missing]
    if names:
        cases = [] if case_set is None else [f"--cases={case_set}"]
        main(["film", str(folder), *names, *cases, "--in-view"])


def _films_text(folder: Path) -> str:
    """Return the number of films that the page shows, and of pairs that could be filmed."""
    films, traced = films_in(folder).keys(), traced_in(folder)
    others = len(traced - films)
    more = (
        f"; traces of {counted(others, 'more pair')}: libero-max film {folder} --select=all" if others else ""
    )
    return f"The page shows films of {counted(len(films), 'pair')}{more}."


def _page_shows_all(folder: Path) -> bool:
    """Return True if there is a page, and it has the films that lie beside it."""
    try:
        page = (folder / _PAGE).read_text(encoding="utf-8")
    except FileNotFoundError:
        return False
    return all(path.rpartition("/")[2] in page for path in films_in(folder).values())


class _Files(SimpleHTTPRequestHandler):
    """Files of the folder, in parts where a browser asks for one, as it does to step through a film."""

    def send_head(self) -> io.BytesIO | BinaryIO | None:
        file = Path(self.translate_path(self.path))
        if not file.resolve().is_relative_to(Path(self.directory).resolve()):  # a link in a folder of others
            self.send_error(HTTPStatus.NOT_FOUND)
            return None
        return super().send_head()

    def do_GET(self) -> None:
        asked = _RANGE.fullmatch(self.headers.get("Range", ""))
        file = Path(self.translate_path(self.path))
        inside = file.resolve().is_relative_to(Path(self.directory).resolve())
        if asked is None or not inside or not file.is_file():
            super().do_GET()
            return
        content = file.read_bytes()
        first, last = int(asked[1]), min(int(asked[2] or len(content)), len(content) - 1)
        if first > last:
            self.send_error(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE)
            return
        self.send_response(HTTPStatus.PARTIAL_CONTENT)
        self.send_header("Content-Type", self.guess_type(file))
        self.send_header("Content-Range", f"bytes {first}-{last}/{len(content)}")
        self.send_header("Content-Length", str(last + 1 - first))
        self.end_headers()
        self.wfile.write(content[first : last + 1])

    def log_message(self, format: str, *values: Any) -> None:
        pass

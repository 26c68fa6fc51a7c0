"""TensorBoard: an event file with the numbers of a run, its table of pairs, and its films of regressions.

Several runs may be written into one folder, each with its step: they are one curve.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

from pytest_libero_max.lab.exports.tracked import PREFIX, gif_of, markdown_table, required, tracked
from pytest_libero_max.report.exports import ExportedRun

_NAME = "tensorboard"


def write(run: ExportedRun, place: Path) -> list[Path]:
    """Write an event file into a folder, with the package ``tensorboard`` alone: no TensorFlow, no PyTorch.

    The time of the events is that at which the run began. A film is an animated GIF, under "Images".
    """
    writers = required("tensorboard.summary.writer.event_file_writer", _NAME)
    events = required("tensorboard.compat.proto.event_pb2", _NAME)
    shown = tracked(run)
    began = run.stored.run.provenance.get("started")
    began_s = datetime.fromisoformat(began).timestamp() if began else 0.0
    before = {*place.glob("*")} if place.is_dir() else set()
    writer = writers.EventFileWriter(str(place))
    for value in _values(shown):
        writer.add_event(events.Event(wall_time=began_s, step=run.step, summary=value))
    writer.close()
    return sorted({*place.glob("*")} - before)


def _values(shown: Any) -> Any:
    summaries = required("tensorboard.compat.proto.summary_pb2", _NAME)
    summary, value = summaries.Summary, summaries.Summary.Value
    for name, number in shown.numbers.items():
        yield summary(value=[value(tag=name, simple_value=number)])
    yield summary(value=[_text(f"{PREFIX}/pairs", markdown_table(shown.rows))])
    for name, film in shown.films.items():
        content, width, height = gif_of(film)
        image = summary.Image(height=height, width=width, colorspace=3, encoded_image_string=content)
        yield summary(value=[value(tag=f"{PREFIX}/films/{name}", image=image)])


def _text(tag: str, text: str) -> Any:
    """Return a value for TensorBoard's page of texts, which draws Markdown."""
    summaries = required("tensorboard.compat.proto.summary_pb2", _NAME)
    tensors = required("tensorboard.compat.proto.tensor_pb2", _NAME)
    types = required("tensorboard.compat.proto.types_pb2", _NAME)
    plugin = required("tensorboard.plugins.text.metadata", _NAME)
    content = tensors.TensorProto(dtype=types.DT_STRING, string_val=[text.encode()])
    metadata = plugin.create_summary_metadata(display_name="", description="")
    return summaries.Summary.Value(tag=tag, metadata=metadata, tensor=content)

"""Reads a dataset with LeRobot, and prints what a training would get, as JSON.

python lerobot_dataset.py FOLDER INDEX...
"""

from __future__ import annotations

import json
import sys
from typing import Any

from lerobot.datasets.lerobot_dataset import LeRobotDataset


def main(folder: str, *indices: str) -> None:
    dataset: Any = LeRobotDataset("libero-max/demos", root=folder)
    items = []
    for index in map(int, indices):
        item = dataset[index]
        items.append(
            {
                key: value if isinstance(value, str) else value.tolist()
                for key, value in item.items()
                if not key.startswith("observation.images")
            }
            | {
                key: (value * 255).round().int().permute(1, 2, 0).tolist()
                for key, value in item.items()
                if key.startswith("observation.images")
            }
        )
    counts = [dataset.num_episodes, dataset.num_frames, dataset.fps]
    print(json.dumps({"counts": counts, "items": items, "statistics": sorted(dataset.meta.stats)}))


if __name__ == "__main__":
    main(*sys.argv[1:])

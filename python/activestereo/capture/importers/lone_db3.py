# SPDX-License-Identifier: Apache-2.0
"""A ROS 2 bag of one .db3 file, as librealsense records since 2.58: without the metadata.yaml that readers ask for."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from activestereo.common.output_files import write_text


@contextmanager
def described(path: Path) -> Iterator[Path]:
    """Makes a folder with a link to the file and its metadata.yaml; only reads the file. Raises sqlite3.Error if it is
    no such bag."""
    with TemporaryDirectory(prefix="activestereo.") as name:
        folder = Path(name)
        (folder / path.name).symlink_to(path.absolute())
        write_text(folder / "metadata.yaml", json.dumps(_metadata(path)))  # JSON is YAML
        yield folder


def _metadata(path: Path) -> dict[str, object]:
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as file:
        count, first, last = file.execute("SELECT COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages").fetchone()
        counts = dict(file.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id").fetchall())
        topics = file.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
    return {
        "rosbag2_bagfile_information": {
            "version": 5,
            "storage_identifier": "sqlite3",
            "relative_file_paths": [path.name],
            "starting_time": {"nanoseconds_since_epoch": first or 0},
            "duration": {"nanoseconds": (last or 0) - (first or 0)},
            "message_count": count,
            "compression_format": "",
            "compression_mode": "",
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": topic, "type": kind, "serialization_format": form, "offered_qos_profiles": ""
                    },
                    "message_count": counts.get(number, 0),
                }
                for number, topic, kind, form in topics
            ],
        }
    }  # fmt: skip

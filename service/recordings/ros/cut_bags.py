"""Messages of MCAP files and rosbag2 databases that the package rosbags cannot read, such as those of a
recorder that crashed: in file order, up to the point where the file ends or is damaged.

In MCAP files, a truncated compressed chunk is lost, usually 1 MB. From an SQLite database, all messages are
recovered that SQLite finds without the missing pages.
"""

import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from contactsense.service.recordings.file_format import format_of

STORAGE = (".mcap", ".db3")
"""File name extensions of files with messages."""
_SPECIAL = re.compile("[#?%]")
"""Characters that have a meaning in the address of an SQLite database."""


def storage_files(path: Path) -> list[Path]:
    """The files that hold the messages of a bag, in the order of the numbers in their names: a recorder that
    splits a bag counts them, and the tenth comes after the second."""
    if not path.is_dir():
        return [path]
    return sorted((file for file in path.iterdir() if format_of(file) in STORAGE), key=_numbered)


def _numbered(file: Path) -> list[tuple[str, int]]:
    """The parts of a name before each number, and the numbers."""
    return [(text, int(number or 0)) for text, number in re.findall(r"([^0-9]*)([0-9]*)", file.name)]


def readable_by_rosbags(path: Path) -> bool:
    """Whether the package rosbags opens the files of a bag: it takes the path of a database for an address,
    in which some characters have a meaning."""
    return not any(format_of(file) == ".db3" and _SPECIAL.search(str(file)) for file in storage_files(path))


def raw_messages(path: Path) -> Iterator[tuple[str, str, bytes]]:
    """Topic, type and serialized content of each message of a file.

    Raises:
        OSError, ValueError: The file ends too early or is damaged at this point; the messages before it can
            be used.
    """
    yield from _of_mcap(path) if format_of(path) == ".mcap" else _of_database(path)


def _of_mcap(path: Path) -> Iterator[tuple[str, str, bytes]]:
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import StreamReader

    types: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    # A damaged length must not be used as the size of a record.
    limit = path.stat().st_size
    with path.open("rb") as file:
        records = StreamReader(file, validate_crcs=True, record_size_limit=limit).records
        while True:
            try:
                record = next(records)
            except StopIteration:
                return
            # Compressed chunks can raise errors of the compression packages as well as those of the format.
            except Exception as error:
                raise ValueError(str(error) or "the file ends too early") from None
            if isinstance(record, Schema):
                types[record.id] = record.name
            elif isinstance(record, Channel):
                channels[record.id] = record.topic, types.get(record.schema_id, "")
            elif isinstance(record, Message):
                if record.channel_id not in channels:
                    raise ValueError(f"a message of channel {record.channel_id}, which is not in the file")
                yield *channels[record.channel_id], record.data


def _of_database(path: Path) -> Iterator[tuple[str, str, bytes]]:
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
            # SQLite refuses a file that is shorter than its header says, unless it is opened for repair.
            database.execute("PRAGMA writable_schema = ON")
            topics = {
                number: (name, kind)
                for number, name, kind in database.execute("SELECT id, name, type FROM topics")
            }
            for topic, data in database.execute("SELECT topic_id, data FROM messages ORDER BY rowid"):
                if topic not in topics:
                    raise ValueError(f"a message of topic {topic}, which is not in the file")
                yield *topics[topic], data
    except sqlite3.Error as error:
        raise ValueError(str(error)) from None

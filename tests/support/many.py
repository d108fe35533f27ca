"""A large result, of the rows of a real small one under other names."""

import csv
import itertools
import shutil
from pathlib import Path

from freepath.results.folder import RUN, SUMMARY, read_rows


def many(result: Path, folder: Path, count: int = 10_000, media: int = 5) -> Path:
    """Write `count` rows into a new folder: those of a run, as if of more media and parameters.

    Each repetition has other ids, names and slightly other times; `media` names of media share
    them. The times to an error are stretched as the time of a sample is.
    """
    folder.mkdir()
    rows = [row for row in read_rows(result / SUMMARY) if row["status"] == "ok"]
    times = ("time_per_sample_s", "time_to_10pct_s", "time_to_1pct_s", "time_to_0.1pct_s")
    with (folder / SUMMARY).open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        turns = ((turn, row) for turn in itertools.count() for row in rows)
        for number, (turn, row) in enumerate(itertools.islice(turns, count)):
            case = row["case"].split("/")
            case[1] = medium = f"{row['medium']}-{turn % media}"
            case[-3] = label = f"{row['tracker_label']}-p={turn // media}"
            stretched = {name: str(float(row[name]) * (1 + turn / 97)) for name in times}
            ids = {"case_id": f"{number:012d}", "case": "/".join(case), "medium": medium}
            writer.writerow(row | stretched | ids | {"tracker_label": label})
    shutil.copy(result / RUN, folder / RUN)
    return folder

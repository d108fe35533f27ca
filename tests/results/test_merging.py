"""Results of several runs in one folder."""

import json

import pytest
from tests.results.test_results import row_of, written

from freepath.cli import main
from freepath.results.folder import SUMMARY, read_result


@pytest.fixture
def shards(tmp_path):
    """Three of four shards, the last of which did not end."""
    folders = []
    for number, case in enumerate("abc", 1):
        folder = tmp_path / f"shard-{number}"
        results = written(folder, row_of(case, run_id=f"r{number}", rounds=2, samples_per_ray=2))
        session = {"shard": f"{number}/4", "ended": "complete" if case != "c" else "failed"}
        listed = [{"case_id": case, "device": "thing"}]
        results.write_run({"config_text": "x", "sessions": [session], "cases": listed})
        folders.append(folder)
    return folders


def test_rows_of_all_and_what_is_missing(shards, tmp_path, capsys):
    (shards[1] / "pictures").mkdir()
    (shards[1] / "pictures" / "b.png").write_bytes(b"b")
    assert main(["merge", *map(str, shards), "-o", str(tmp_path / "all")]) == 0
    rows, rounds = read_result(tmp_path / "all")
    assert [row["case_id"] for row in rows] == ["a", "b", "c"]
    assert len(rounds) == 6
    whole = [b"".join((one / SUMMARY).read_bytes().splitlines(True)[1:]) for one in shards]
    assert (tmp_path / "all" / SUMMARY).read_bytes().endswith(b"".join(whole))
    facts = json.loads((tmp_path / "all" / "run.json").read_text())
    assert [one["shard"] for one in facts["sessions"]] == ["1/4", "2/4", "3/4"]
    assert [one["case_id"] for one in facts["cases"]] == ["a", "b", "c"]
    assert (tmp_path / "all" / "pictures" / "b.png").read_bytes() == b"b"
    told = capsys.readouterr().err
    assert "shard-3: is not complete" in told
    assert "shards missing of 4: 4" in told
    assert "shard-1" not in told


def test_what_is_refused_leaves_nothing(shards, tmp_path, capsys):
    out = tmp_path / "all"

    def refused(*results):
        assert main(["merge", *map(str, results), "-o", str(out)]) == 2
        assert not out.exists()
        return capsys.readouterr().err

    a, b, _ = shards
    place = f"{a / SUMMARY}:2: transmittance/m/a/auto/strict on thing: {a / SUMMARY}:2 has a row"
    assert place in refused(a, b, a)
    facts = json.loads((b / "run.json").read_text())
    (b / "run.json").write_text(json.dumps(facts | {"config_text": "y"}))
    assert f"{b}: is of another config than {a}" in refused(a, b)
    (b / "run.json").write_text(json.dumps(facts))
    (b / SUMMARY).write_text("a,b\n")
    assert "its columns are not those of schema version" in refused(a, b)
    assert "nowhere: expected the folder of a run, with summary.csv" in refused(
        a, tmp_path / "nowhere"
    )
    (tmp_path / "mine").mkdir()
    assert main(["merge", str(a), "-o", str(a)]) == 2
    assert "already holds" in capsys.readouterr().err


def test_links_in_a_result_are_not_read(shards, tmp_path):
    secret = tmp_path / "secret"
    secret.mkdir()
    (secret / "s.png").write_bytes(b"secret")
    (shards[0] / "pictures").symlink_to(secret)
    (shards[1] / "pictures").mkdir()
    (shards[1] / "pictures" / "t.png").symlink_to(secret / "s.png")
    assert main(["merge", *map(str, shards), "-o", str(tmp_path / "all")]) == 0
    assert not (tmp_path / "all" / "pictures").exists()

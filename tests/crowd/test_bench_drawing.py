"""The benchmark of pictures draws everyone and says what a picture costs."""

import json

import pytest

from crowd.cli import exit_code


def test_the_benchmark_of_pictures_counts_everyone(tmp_path, capsys):
    pytest.importorskip("moderngl")
    from crowd_viewer import ViewerError
    from crowd_viewer.context import headless_context

    try:
        headless_context()
    except ViewerError as error:
        pytest.skip(str(error))
    path = tmp_path / "drawing.json"
    assert exit_code(["bench", "drawing", "--characters", "60", "--json", str(path)]) == 0
    rows = json.loads(path.read_text())
    assert [row["case"] for row in rows] == ["limbs", "window", "best"]
    for row in rows:
        assert sum(row["levels"]) == 60
        assert row["fps"] > 0.1
        assert 0.0 < row["upload_mb"] < 1.0
        assert row["machine"]["renderer"]
    # Without skins nobody is drawn as a mesh.
    assert sum(rows[0]["levels"][:3]) == 0
    assert "fps" in capsys.readouterr().out

"""Trajectories of other programs: every format gives the same ways, and broken files are named."""

import sqlite3

import h5py
import numpy as np
import pytest
import shapely

import crowd
from crowd.cli import exit_code
from crowd.errors import RecordingError
from crowd.recording import Recorder
from crowd.trajectories.trajectories import Trajectories, Way

ROWS = [(frame, number, 0.1 * frame + number, 0.5 * number) for frame in range(20) for number in (3, 7)]
RATE = 10.0
AREA = "POLYGON ((-1 -2, 12 -2, 12 8, -1 8, -1 -2), (2 6, 3 6, 3 7, 2 7, 2 6))"


def write_csv(path):
    lines = [f"{frame / RATE},{number},{x},{y}" for frame, number, x, y in ROWS]
    path.write_text("\n".join(["t,id,x,y", *lines]))


def write_shuffled_csv(path):
    lines = [f"{y};{number};{x};{frame / RATE}" for frame, number, x, y in ROWS]
    path.write_text("\n".join(['"y";"id";"x";"time"', *reversed(lines)]))


def write_text(path):
    lines = [f"{number}\t{frame}\t{100 * x}\t{100 * y}\t0.0" for frame, number, x, y in ROWS]
    path.write_text("\n".join([f"# framerate: {RATE}", "# id frame x/cm y/cm z/cm", *lines]))


def write_sqlite(path):
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE trajectory_data (frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL)")
    connection.execute("CREATE TABLE metadata (key TEXT, value TEXT)")
    connection.execute("CREATE TABLE geometry (hash INTEGER, wkt TEXT)")
    connection.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?)", ROWS)
    connection.executemany("INSERT INTO metadata VALUES (?, ?)", [("version", "2"), ("fps", str(RATE))])
    connection.execute("INSERT INTO geometry VALUES (1, ?)", (AREA,))
    connection.commit()
    connection.close()


def write_hdf5(path):
    kind = [("frame", "u4"), ("id", "u4"), ("x", "f8"), ("y", "f8"), ("z", "f8")]
    with h5py.File(path, "w") as file:
        file["trajectory"] = np.array([(*row, 0.0) for row in ROWS], kind)
        file["trajectory"].attrs["fps"] = RATE
        file.attrs["wkt_geometry"] = AREA


WRITERS = {
    "a.csv": write_csv,
    "b.csv": write_shuffled_csv,
    "a.txt": write_text,
    "a.sqlite": write_sqlite,
    "a.h5": write_hdf5,
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_same_ways(tmp_path, name):
    WRITERS[name](tmp_path / name)
    found = crowd.load_trajectories(tmp_path / name)
    assert [way.number for way in found.ways] == [3, 7]
    for way in found.ways:
        expected = np.array([(frame / RATE, y, x) for frame, number, x, y in ROWS if number == way.number])
        assert way.time == pytest.approx(expected[:, 0])
        # Their y is our x, their x our z.
        assert way.position == pytest.approx(expected[:, 1:])
    if name in ("a.sqlite", "a.h5"):
        assert found.area.equals(shapely.transform(shapely.from_wkt(AREA), lambda p: p[:, ::-1]))


def test_an_exported_run_comes_back_where_it_was(tmp_path):
    simulation = crowd.Simulation(crowd.load_scenario("bottleneck"), seed=5, characters=12, threads=1)
    with Recorder(tmp_path / "run.h5", simulation) as recorder:
        for _ in range(120):
            recorder.record(simulation.step())
    for form, name in (("csv", "run.csv"), ("jupedsim", "run.sqlite")):
        command = ["export", tmp_path / "run.h5", "--to", form, "--out", tmp_path / name]
        assert exit_code([str(part) for part in command]) == 0
        found = crowd.load_trajectories(tmp_path / name)
        with crowd.Recording(tmp_path / "run.h5") as recording:
            position = recording.read("position_world")
        assert len(found.ways) == 12
        for number, way in enumerate(found.ways):
            assert way.position == pytest.approx(position[:, number][:, [0, 2]], abs=2e-6)


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.csv", "t,id,x,y\n0,1,2,3\n0.1,1,here,3\n", "is broken"),
        ("a.csv", "t,id,x\n0,1,2\n", "lacks columns"),
        ("a.csv", "0,1,2,3\n0,1,2,3\n", "holds a point twice at one time; got 'id 1 at 0 s'"),
        ("a.csv", "t,id,x,y\n0,1,nan,3\n", "holds a number that is not finite"),
        ("a.csv", "t,id,x,y\n", "holds no trajectories"),
        ("a.txt", "# framerate: fast\n1 0 2 3\n", "tells no frame rate"),
        ("a.txt", "hello\n", "lacks columns; got 'hello'"),
        ("a.txt", "", "is no trajectory file"),
        ("a.sqlite", "SQLite format 3\x00 and nothing else", "is no JuPedSim trajectory file"),
        ("a.bin", "\x89HDF\r\n\x1a\n", "is no trajectory file"),
        ("a.jpg", "\xff\xd8\xff", "is no trajectory file"),
    ],
)
def test_a_broken_file_is_named_with_what_is_wrong(tmp_path, name, content, expected):
    (tmp_path / name).write_bytes(content.encode("latin-1"))
    with pytest.raises(RecordingError, match=expected) as caught:
        crowd.load_trajectories(tmp_path / name)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert "\n" not in str(caught.value)


def test_trajectories_are_shown_in_one_line(tmp_path):
    write_csv(tmp_path / "tracks.csv")
    trajectories = crowd.load_trajectories(tmp_path / "tracks.csv")
    assert repr(trajectories) == "Trajectories of tracks.csv: 2 people, 20 frames, 1.90 s"
    # Who comes back is one person, and two people of the same moment make one frame.
    ways = tuple(
        Way(number, time + np.arange(3.0), np.zeros((3, 2))) for number, time in ((1, 0), (2, 1), (1, 9))
    )
    assert repr(Trajectories("x", ways)) == "Trajectories of x: 2 people, 7 frames, 11.00 s"
    assert repr(Trajectories("x", ())) == "Trajectories of x: 0 people, 0 frames, 0.00 s"


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(RecordingError, match="cannot be read; got 'No such file"):
        crowd.load_trajectories(tmp_path / "a.csv")


def test_who_leaves_and_comes_back_or_jumps_has_several_ways(tmp_path):
    rows = ["0,1,0,0", "0.5,1,0.5,0", "9,1,5,0", "9.5,1,5.5,0", "10,1,40,0", "10.5,1,40.5,0"]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    found = crowd.load_trajectories(tmp_path / "a.csv")
    assert [len(way.time) for way in found.ways] == [2, 2, 2]

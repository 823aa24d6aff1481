"""`elk.Log`, and the explorer of the examples, in a mission of its own."""

import json
import os
import subprocess
import sys
import tempfile
import unittest
import zlib
from pathlib import Path

import numpy

import elk
from bus import ELK, PATIENCE

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "bus/python/examples/my_explorer.py"


class Mission(unittest.TestCase):
    """A coarse run in the car with the explorer of the examples, recorded."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        mission = str(ROOT / "mission-files/car.xml")
        coarse = ["Map.Res=0.25", "Explorer.Res=0.25", "Sensor.Width=24", "Sensor.Height=24"]
        settings = [word for one in [f"Explorer.exec={EXAMPLE}", *coarse] for word in ("--set", one)]
        command = [ELK, "launch", mission, "--headless", "--community", f"python-{os.getpid()}-mission", *settings]
        # The example begins with /usr/bin/env python3, which is to be this one.
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        environment = {**os.environ, "PATH": path}
        cls.done = subprocess.run(
            command, cwd=cls.folder.name, env=environment, capture_output=True, text=True, timeout=10 * PATIENCE
        )
        runs = list(Path(cls.folder.name).glob("logs/*"))
        assert len(runs) == 1, cls.done
        cls.run_folder = runs[0]
        cls.log = elk.Log(cls.run_folder)

    def test_the_explorer_of_the_examples_explores_the_car(self):
        self.assertEqual(self.done.returncode, 0, self.done.stdout + self.done.stderr)
        summary = json.loads((self.run_folder / "summary.json").read_text())
        self.assertEqual((summary["complete"], summary["contacts"]), (True, 0))
        self.assertEqual(summary["explorer"], "my_explorer.py")
        self.assertEqual(summary["frontiers_left"]["open"], 0)
        self.assertGreater(summary["known_voxels"], 4000)

    def test_the_example_is_short(self):
        lines = [line.strip() for line in EXAMPLE.read_text().splitlines()]
        self.assertLess(sum(1 for line in lines if line and not line.startswith("#")), 80)

    def test_a_log_says_where_it_came_from_and_what_is_in_it(self):
        self.assertEqual(self.log.metadata["mission_name"], "car.xml")
        self.assertIn("Explorer", self.log.metadata["effective_mission"])
        variables = self.log.variables()
        heard = {}
        for message in self.log:
            heard[message.key()] = heard.get(message.key(), 0) + 1
        self.assertEqual(variables, heard)
        self.assertGreater(variables["PLAN"], 3)

    def test_columns_are_what_the_messages_say(self):
        messages = [one for one in self.log if one.is_name("SIM_SENSOR")]
        columns = self.log.columns("SIM_SENSOR")
        self.assertEqual({len(column) for column in columns.values()}, {len(messages)})
        self.assertEqual(columns["time"].tolist(), [one.time() for one in messages])
        poses = [one.value()["pose"]["translation"] for one in messages]
        for axis, name in enumerate("xyz"):
            self.assertEqual(columns[f"pose.{name}"].tolist(), [pose[axis] for pose in poses])
        self.assertEqual(columns["pose.x"].dtype, numpy.dtype("f8"))
        table = self.log.table("SIM_SENSOR")
        self.assertEqual(list(table), list(columns), "a DataFrame, or the columns")

    def test_numbers_and_texts_have_columns(self):
        cpu = self.log.columns("EXPLORER_STATUS")
        self.assertTrue(all("MOOSName=Explorer" in text for text in cpu["text"]))
        self.assertTrue((self.log.columns("MAP_REQUEST")["value"] == 1).all())

    def test_what_is_not_there_is_said(self):
        with self.assertRaisesRegex(elk.Error, "no message of NOBODY_S is in .*; variables\\(\\) says which are"):
            self.log.columns("NOBODY_S")
        with self.assertRaisesRegex(elk.Error, "nowhere"):
            elk.Log("nowhere")
        broken = Path(self.folder.name) / "broken.mcap"
        broken.write_bytes(b"no log at all")
        with self.assertRaises(elk.Error):
            list(elk.Log(broken))

    def test_a_damaged_log_is_read_as_far_as_it_goes_or_refused_in_words(self):
        whole = next(self.run_folder.glob("*.mcap")).read_bytes()
        file, read = Path(self.folder.name) / "damaged.mcap", 0
        for number in range(30):
            damaged, noise = bytearray(whole), number
            for _ in range(1 + number % 5 * 20):
                noise = zlib.crc32(noise.to_bytes(4, "little"))
                # The head of a log is where most is decided.
                at = noise % (len(whole) if number % 2 else 4000)
                damaged[at] ^= 1 << noise % 8
            file.write_bytes(damaged[: len(whole) if number % 3 else noise % len(whole)])
            for look in [
                lambda log: log.variables(),
                lambda log: log.columns("SIM_SENSOR"),
                lambda log: log.columns("PROGRESS"),
                lambda log: [message.value() for message in log],
            ]:
                # A panic of Rust's is no error of elk's.
                try:
                    look(elk.Log(file))
                    read += 1
                except elk.Error as refusal:
                    self.assertTrue(str(refusal))
        self.assertGreater(read, 20)

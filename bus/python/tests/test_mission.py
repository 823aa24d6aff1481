"""`elk.Mission` and `elk.evaluate`: missions and suites from Python, and the example's row in a table."""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy

import elk
from bus import ELK

ROOT = Path(__file__).resolve().parents[3]
CAR = ROOT / "mission-files/car.xml"
EXAMPLE = ROOT / "bus/python/examples/my_explorer.py"
COARSE = {"Map.Res": 0.25, "Explorer.Res": "0.25 m", "Sensor.Width": 24, "Sensor.Height": 24}


class Program(unittest.TestCase):
    """A test with a folder of its own, in which `elk` is the one that is tested."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        # The example begins with /usr/bin/env python3, which is to be this one.
        for name, value in {"ELK": ELK, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}.items():
            before = os.environ.get(name)
            self.addCleanup(self.restore, name, before)
            os.environ[name] = value

    def restore(self, name, value):
        os.environ.pop(name, None)
        if value is not None:
            os.environ[name] = value


class Mission(Program):
    def test_a_mission_is_launched_and_waited_for(self):
        mission = elk.Mission(CAR, COARSE).set("Explorer.type", "ClosestFrontier")
        self.assertIn("is right", mission.check())
        run = mission.launch(community=f"python-{os.getpid()}-launched", log_dir=self.folder, in_process=True)
        self.assertTrue(run.complete)
        self.assertEqual((run.summary["contacts"], run.summary["explorer"]), (0, "ClosestFrontier"))
        self.assertGreater(run.summary["path_length_m"], 1)
        self.assertEqual(run.folder.parent, self.folder)
        self.assertGreater(run.log.variables()["PLAN"], 3)

    def test_a_run_that_is_not_complete_is_a_run(self):
        mission = elk.Mission(CAR, {**COARSE, "Explorer.MaxScans": 3})
        run = mission.launch(community=f"python-{os.getpid()}-capped", log_dir=self.folder, in_process=True)
        self.assertFalse(run.complete)
        self.assertGreater(len(run.summary["reason"]), 3)

    def test_what_is_wrong_is_said_in_elk_s_words(self):
        with self.assertRaisesRegex(elk.Error, r"--set Map.Ress=0.1: .*did you mean Res\?"):
            elk.Mission(CAR, {"Map.Ress": 0.1}).check()
        with self.assertRaisesRegex(elk.Error, "no/such"):
            elk.Mission("no/such.xml").launch(log_dir=self.folder)
        os.environ["ELK"] = str(self.folder / "elk")
        with self.assertRaisesRegex(elk.Error, "cannot be run: .*ELK="):
            elk.Mission(CAR).check()

    def test_python_s_values_are_parameters(self):
        flag = elk.Mission(CAR, {"Controller.Manual": False, "Explorer.Mid": (0, 0, 0.5), "Explorer.Dim": numpy.array([3, 3, 3])})
        self.assertIn("is right", flag.check())

    def test_help_has_units(self):
        script = "import elk; help(elk.Mission); help(elk.Run); help(elk.evaluate); help(elk.Log.columns)"
        said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
        for words in ["path_length_m` (m)", "way_m` (m)", "(s, the community's clock)", "App.Param"]:
            self.assertIn(words, said)


class Evaluate(Program):
    def suite(self, explorers):
        settings = " ".join(f'{name}="{value}"' for name, value in COARSE.items())
        suite = self.folder / "suite.xml"
        suite.write_text(
            f'<Suite name="mine" starts="2" seed="5"><World name="car" mission="{CAR}" {settings}/>{explorers}'
            '<Limits answer="60 s"/></Suite>'
        )
        return suite

    def test_the_explorer_of_the_examples_has_its_row_in_the_table(self):
        # By itself: it needs no other file.
        mine = shutil.copy(EXAMPLE, self.folder)
        explorers = f'<Explorer type="ClosestFrontier"/><Explorer name="mine" pipe="{mine}"/>'
        rows = elk.evaluate(self.suite(explorers), self.folder / "results", jobs=1)
        self.assertEqual([row["strategy"] for row in rows], ["ClosestFrontier", "mine"] * 2)
        for row in rows:
            self.assertEqual((row["end"], row["contacts"]), ("complete", 0), row)
        ways = numpy.array([row["way_m"] for row in rows])
        self.assertEqual(ways.dtype, numpy.dtype("f8"))
        self.assertTrue((ways > 1).all())
        self.assertIn("| mine |", (self.folder / "results/table.md").read_text())
        # What is there is not run again.
        self.assertEqual(repr(elk.evaluate(self.suite(explorers), self.folder / "results")), repr(rows))

    def test_a_run_that_fails_is_a_row_and_a_wrong_suite_an_error(self):
        failing = self.folder / "fails.py"
        failing.write_text(
            "#!/usr/bin/env python3\nimport elk\n\nclass Explorer(elk.App):\n    def on_start_up(self):\n"
            "        self.register('PLAN_REQUEST')\n\n    def on_new_mail(self, message):\n"
            "        raise ValueError('no such thing')\n\nExplorer().run()\n"
        )
        failing.chmod(0o755)
        rows = elk.evaluate(self.suite(f'<Explorer name="fails" pipe="{failing}"/>'), self.folder / "failed")
        self.assertEqual({row["end"] for row in rows}, {"failed"})
        self.assertIn("Explorer: on_new_mail(PLAN_REQUEST) raised ValueError: no such thing", rows[0]["reason"])
        with self.assertRaisesRegex(elk.Error, "suite.xml:1:.* there is no Explorer of type"):
            elk.evaluate(self.suite('<Explorer type="Closet"/>'), self.folder / "wrong")

"""Typed values as Python's own, by the description that travels with the type: those of elk's map and controller."""

import gc
import math
import subprocess
import threading
import time

import numpy

import elk
from bus import ELK, PATIENCE, OnABus, eventually


class Types(OnABus):
    def setUp(self):
        super().setUp()
        # Whoever has registered says how it is from then on.
        self.writer = self.client("writer", ["*_STATUS"])
        self.reader = self.client("reader", ["SCAN", "PLAN", "NAMED", "BACK"])

    def start(self, element, *parameters):
        """An app of elk's, whose types the community knows from then on."""
        command = [ELK, element, "--community", self.community, *parameters]
        app = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(self.end, app)

    def start_map(self):
        self.start("map", "--type", "OctoMap", "Res=0.1", "Input=SCAN")
        return eventually(lambda: self.writer.describe("SCAN"), "the type of SCAN")["example"]

    def start_controller(self):
        self.start("controller", "--type", "MOOSSim")
        return eventually(lambda: self.writer.describe("PLAN"), "the type of PLAN")["example"]

    def scan(self, example, points):
        return dict(example, points=numpy.arange(3 * points, dtype="<f4").reshape(-1, 3), measured=points)

    def test_what_a_variable_carries_is_said_with_an_example(self):
        self.start_controller()
        said = self.writer.describe("PLAN")
        self.assertEqual(said["type"], "Plan")
        self.assertIn("request", said["example"])
        self.assertIn("docs", said["description"]["struct"])
        self.assertIsNone(self.writer.describe("NOBODY_S"))

    def test_two_threads_ask_at_once(self):
        self.start_controller()
        said = []
        ask = lambda: said.append(self.writer.describe("PLAN")["type"])
        threads = [threading.Thread(target=ask) for _ in range(8)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        self.assertEqual(said, ["Plan"] * 8)

    def test_dicts_travel_and_come_back_as_they_were(self):
        example = self.start_controller()
        go = {"points": [[0.5, 1.0, -2.0], [math.inf, 0.1, 1e-300]], "target": {"x": 1, "y": -2, "z": 3}}
        for decision in ["Done", {"Go": dict(go, unknown=[{"x": 0, "y": 0, "z": 0}], looks=[], again=False)}]:
            plan = dict(example, request=2**40, decision=decision)
            self.writer.notify("PLAN", plan)
            message = self.hear(self.reader, "PLAN")
            self.assertEqual((message.type_name(), message.is_binary()), ("Plan", True))
            value = message.value()
            if decision != "Done":
                value["decision"]["Go"]["points"] = numpy.asarray(value["decision"]["Go"]["points"]).tolist()
            self.assertEqual(value, plan)

    def test_a_value_that_is_none_is_refused_with_its_field(self):
        scan, plan = self.start_map(), self.start_controller()
        points = numpy.zeros((4, 3))
        for variable, wrong, words in [
            ("PLAN", dict(plan, request=-1), "this is no Plan: request is -1; it has to be a number from 0"),
            ("PLAN", dict(plan, odd=1), "has no field odd; it has request"),
            ("SCAN", dict(scan, points=points[:, :2]), r"points is an array of shape \[4, 2\]; right is one of shape \(n, \[3\]\)"),
            ("SCAN", dict(scan, points=points.astype("c8")), "points is an array of complex64; right is <f4"),
            ("SCAN", dict(scan, points=points, odd=1), "there is no field odd; right are id, command"),
            ("SCAN", {"points": points}, "this is no Scan: id is missing"),
            ("SCAN", dict(scan, points=points, id=-3), "this is no Scan: id is -3"),
            ("SCAN", [1], "this is no Scan"),
        ]:
            with self.assertRaisesRegex(elk.Error, words):
                self.writer.notify(variable, wrong)
        with self.assertRaisesRegex(elk.Error, "PLAN carries Plan, and not Scan"):
            self.writer.notify("PLAN", plan, type="Scan")
        self.writer.notify("NAMED", plan, type="Plan")
        self.assertEqual(self.hear(self.reader, "NAMED").type_name(), "Plan")

    def test_points_are_arrays_over_the_bytes_and_cannot_be_written(self):
        example = self.start_map()
        for points in [0, 5, 100_000]:
            for _ in range(3):
                sent = self.scan(example, points)
                self.writer.notify("SCAN", sent)
                message = self.hear(self.reader, "SCAN")
                scan = message.value()["points"]
                self.assertEqual((scan.shape, scan.dtype), ((points, 3), numpy.dtype("f4")))
                self.assertTrue((scan == sent["points"]).all())
                self.assertFalse(scan.flags.writeable)
                data = message.binary_data()
                self.assertEqual(len(data), message.binary_data_size())
                inside = numpy.asarray(data).ctypes.data <= scan.ctypes.data
                self.assertTrue(inside and scan.ctypes.data + scan.nbytes <= numpy.asarray(data).ctypes.data + len(data))
                self.assertFalse(lies_in_shared_memory(scan) and (points < 100_000 or _ == 0), "the first is a copy")
        # Once the writer has heard that the reader looks into its memory, values stay there.
        until = time.monotonic() + PATIENCE
        while not lies_in_shared_memory(scan):
            self.assertLess(time.monotonic(), until, "all values are copies")
            self.writer.notify("SCAN", sent)
            scan = self.hear(self.reader, "SCAN").value()["points"]
            self.assertTrue((scan == sent["points"]).all())

    def test_arrays_stay_what_they_are_for_as_long_as_they_are_held(self):
        example, held = self.start_map(), []
        for number in range(60):
            sent = dict(self.scan(example, 3000), points=numpy.full((3000, 3), number, "f4"))
            self.writer.notify("SCAN", sent)
            held.append(self.hear(self.reader, "SCAN").value()["points"])
        shared = sum(map(lies_in_shared_memory, held))
        self.assertTrue(0 < shared <= 9, f"{shared} lie where they were written, the others are copies")
        self.reader.close()
        for number, points in enumerate(held):
            self.assertTrue((points == number).all(), f"array {number} was overwritten")
        held.clear()
        gc.collect()

    def test_what_is_let_go_of_makes_room_in_shared_memory_again(self):
        example = self.start_map()
        for number in range(60):
            self.writer.notify("SCAN", self.scan(example, 3000))
            points = self.hear(self.reader, "SCAN").value()["points"]
        self.assertTrue(lies_in_shared_memory(points))


def lies_in_shared_memory(array):
    """Whether an array lies in a mapping of shared memory."""
    with open("/proc/self/maps") as maps:
        for line in maps:
            start, end = (int(number, 16) for number in line.split()[0].split("-"))
            if start <= array.ctypes.data < end:
                return "/dev/shm/" in line
    return False

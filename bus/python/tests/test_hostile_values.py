"""Somebody who writes whatever he likes, and whatever Python has for a value: nobody is lost, and who is wrong is told so."""

import json
import math
import subprocess
import tempfile
from pathlib import Path

import numpy

import elk
from bus import ELK, PATIENCE, OnABus, eventually
from recording import spoilt, without_checksums

READER = """
    import elk

    class Reader(elk.App):
        seen = 0

        def on_start_up(self):
            self.register("PLAN")
            self.register("WORD", lossless=True)
            self.notify("STARTED", 1)

        def on_new_mail(self, message):
            if message.key() == "WORD":
                self.notify("SEEN", self.seen)
            else:
                self.seen += 1
                str(message.value())

    Reader().run()
"""

GO = {
    "points": [[0.5, 1.0, -2.0], [1.0, 2.0, 3.0]],
    "target": {"x": 1, "y": -2, "z": 3},
    "unknown": [{"x": 0, "y": 0, "z": 0}],
    "looks": [],
    "again": False,
}


class Selfish:
    """An array that is its own list."""

    def tolist(self):
        return self


class Raising:
    def __getattr__(self, name):
        raise ValueError("there is no such thing")

    def __repr__(self):
        raise ValueError("and no words")


class Liar:
    """Says that it is an array."""

    __array_interface__ = {"version": 3, "typestr": "<f4", "shape": (5, 3), "data": None}
    ndim, shape, size, dtype = 2, (5, 3), 15, numpy.dtype("f4")

    def astype(self, *_, **__):
        return self

    def tobytes(self):
        return b"lies"


def garbage():
    """What Python has for a value that nobody meant."""
    own_list, own_dict, deep = [], {}, []
    own_list.append(own_list)
    own_dict["a"] = own_dict
    for _ in range(100_000):
        deep = [deep]
    number = numpy.float32(0)
    yield from (None, True, 0, -1, 2**64, -(2**31), 10**400, math.nan, math.inf, -1e300, 5e-324, 1j)
    yield from ("", " ", "A\0B", "\x1b[2J", "\ud800", "*", "x" * 257, "x" * 10**6, "..", "a/b", "--help", "DB_CLIENTS")
    yield from (b"", b"\xff" * 10, bytearray(1), memoryview(b"abcdef")[::2], object(), Raising(), Selfish(), Liar(), Liar)
    yield from (own_list, own_dict, deep, {1: 2}, {"\ud800": 1}, {1}, range(3), (n for n in range(3)), garbage, math)
    yield from (numpy.zeros(()), numpy.zeros((0, 3)), numpy.array([object(), 1]), numpy.zeros(3, "c16"), numpy.array(["a"]))
    yield from (numpy.zeros(2, [("a", "f4")]), numpy.arange(12.0).reshape(4, 3).T, numpy.arange(9.0)[::-1], number)
    yield numpy.broadcast_to(number, (10**12, 3))  # 12 TB, in no memory


class Values(OnABus):
    def setUp(self):
        super().setUp()
        # Whoever has registered says how it is from then on.
        self.writer = self.client("writer", ["STARTED", "SEEN", "*_STATUS"])

    def start(self, *arguments):
        process = subprocess.Popen([ELK, *arguments, "--community", self.community], stdout=subprocess.DEVNULL)
        self.addCleanup(self.end, process)
        return process

    def example(self, variable, *app):
        process = self.start(*app)
        described = eventually(lambda: self.writer.describe(variable), f"the type of {variable}")
        return described["example"], process

    def hostile_recording(self):
        """A recording in which each plan is spoilt in its own way, and how many there are."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        good, bad = Path(folder.name) / "good.mcap", Path(folder.name) / "bad.mcap"
        example, controller = self.example("PLAN", "controller", "--type", "MOOSSim")
        plan = dict(example, decision={"Go": GO})
        logger = self.start("logger", "--type", "Mcap", "--name", "recorder", f"File={good}", "Compression=none")
        listener = self.client("listener", ["RECORDER_STATUS", "PLAN"])
        self.hear(listener, "RECORDER_STATUS")
        self.writer.notify("PLAN", plan)
        value = bytes(self.hear(listener, "PLAN").binary_data())
        count = sum(1 for _ in spoilt(value))
        for _ in range(count):
            self.writer.notify("PLAN", plan)
        self.hear(listener, "PLAN", count)
        logger.terminate()
        self.assertEqual(logger.wait(PATIENCE), 0)
        self.end(controller)
        parts = good.read_bytes().split(value)
        self.assertEqual(len(parts), count + 2)
        changed = b"".join(part + bad for part, bad in zip(parts, [value, *spoilt(value)])) + parts[-1]
        bad.write_bytes(without_checksums(changed))
        return bad, count

    def test_bytes_that_are_none_of_their_type_end_no_app_and_none_that_comes_later(self):
        recording, count = self.hostile_recording()
        judge = self.client("judge", ["MAIL_REJECTED"])
        early = self.python(READER)
        self.hear(self.writer, "STARTED")
        self.elk("replay", str(recording), "--community", self.community, "--rate", "max", "--lossless", "--keys", "PLAN")
        self.writer.notify("WORD", 1)
        self.assertEqual(self.hear(self.writer, "SEEN").value(), count + 2, "the last good plan, and all of the recording's")
        words = self.hear(judge, "MAIL_REJECTED").string()
        self.assertRegex(words, r"^app rejects PLAN #\d+ by writer: PLAN: the bytes are no Plan: ")
        self.assertIsNone(early.poll())
        self.end(early)
        # What was last is nothing that can be read.
        self.python(READER)
        self.hear(self.writer, "STARTED")
        self.writer.notify("WORD", 2)
        self.assertEqual(self.hear(self.writer, "SEEN").value(), 1)
        self.hear(judge, "MAIL_REJECTED")

    def test_a_table_of_more_numbers_than_memory_is_refused(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        said, recorded = Path(folder.name) / "wide.alog", Path(folder.name) / "wide.mcap"
        wide = json.dumps({f"number{n}": n for n in range(4000)})
        rows = "".join(f'{1 + row / 1000:.3f} WIDE writer {{"number0":{row}}}\n' for row in range(33_600))
        said.write_text(f"%% LOGSTART 1000\n0.0 WIDE writer {wide}\n{rows}")
        listener = self.client("listener", ["RECORDER_STATUS"])
        logger = self.start("logger", "--type", "Mcap", "--name", "recorder", f"File={recorded}")
        self.hear(listener, "RECORDER_STATUS")
        self.elk("replay", str(said), "--community", self.community, "--rate", "max", "--lossless")
        logger.terminate()
        self.assertEqual(logger.wait(PATIENCE), 0)
        log = elk.Log(recorded)
        self.assertEqual(log.variables()["WIDE"], 33_601)
        with self.assertRaisesRegex(elk.Error, "WIDE: 4000 columns of more than 33.* right is to iterate over the log"):
            log.columns("WIDE")

    def test_whatever_is_given_to_a_function_it_works_or_is_refused_in_words(self):
        scan, _ = self.example("SCAN", "map", "--type", "OctoMap", "Res=0.1", "Input=SCAN")
        one, idle = self.client("one"), elk.comms
        one.add_active_queue("mine", lambda message: None)
        run = lambda community, name: idle().run(community, name)
        calls = [
            one.register,
            lambda it: one.register("X", it),
            lambda it: one.register("X", "*", it),
            lambda it: one.register("X", rate=it),
            lambda it: one.register(var_pattern=it),
            one.unregister,
            lambda it: one.notify(it, 1),
            lambda it: one.notify("VALUE", it),
            lambda it: one.notify("SCAN", it),
            lambda it: one.notify("SCAN", dict(scan, points=it)),
            lambda it: one.notify("SCAN", dict(scan, points=numpy.zeros((1, 3)), id=it)),
            lambda it: one.notify("X", 1, it),
            lambda it: one.notify("X", 1, aux_src=it),
            lambda it: one.notify("X", 1, type=it),
            lambda it: one.notify_binary("BYTES", it),
            one.describe,
            one.is_registered_for,
            one.set_on_connect_callback,
            one.set_on_mail_callback,
            lambda it: idle().add_active_queue(it, print),
            lambda it: idle().add_active_queue("queue", it),
            lambda it: one.add_message_route_to_active_queue(it, "X"),
            one.has_active_queue,
            one.remove_active_queue,
            lambda it: run(it, "name"),
            lambda it: elk.App(it, self.community),
            lambda it: elk.App("app", it),
            lambda it: elk.App("app", self.community).parameter("it", it),
            lambda it: elk.listen(self.community, "listener", it),
            lambda it: elk.time(it) and elk.local_time(it),
            elk.Log,
            elk.Run,
            elk.Mission,
            lambda it: elk.Mission("car", it)._arguments(),
        ]
        for number, call in enumerate(calls):
            for value in garbage():
                with self.subTest(call=number, value=type(value).__name__):
                    try:
                        call(value)
                    # A panic of Rust's is none of these.
                    except Exception as refusal:
                        self.assertTrue(str(refusal) or isinstance(refusal, MemoryError), repr(refusal))
                        self.assertTrue(len(str(refusal)) < 5000 or isinstance(refusal, OSError), repr(refusal)[:100])
        self.assertTrue(one.is_running() and one.is_connected())

    def test_refusals_say_what_where_and_what_is_right(self):
        scan, _ = self.example("SCAN", "map", "--type", "OctoMap", "Res=0.1", "Input=SCAN")
        client, forever, wide = self.client("client"), [], [0] * 10
        forever.append(forever)
        for _ in range(30):
            wide = [wide] * 10  # 10^31 numbers, in no memory
        many = numpy.broadcast_to(numpy.float32(0), (10**9, 3))
        own = {}
        own["own"] = own
        for wrong, words in [
            (lambda: client.notify("X", 10**400), "X: an integer is too large for a number of the bus, .* up to 1.8e308"),
            (lambda: client.notify("X", "\ud800"), "X: a text has half a character in it .* right is text.encode"),
            (lambda: client.notify("X", 1, math.nan), "the time of X is NaN; right is seconds of the community's clock"),
            (lambda: client.notify("X", bytes(2**30 + 1)), "X: a value of 1073741825 bytes; at most 1073741824 are allowed"),
            (lambda: client.notify("SCAN", forever), r"SCAN: \[0\]: values lie more than 64 deep in each other"),
            (lambda: client.notify("SCAN", wide), r"SCAN: \[0\]: there are more than 16777216 values in it; .* in parts"),
            (lambda: client.notify("SCAN", own), "SCAN: values lie more than 64 deep in each other"),
            (lambda: client.notify("SCAN", many), "SCAN: there are more than 16777216 values in it; .* in parts"),
            (lambda: client.notify("SCAN", dict(scan, points=many)), r"points is an array of shape \[1000000000, 3\], and at most"),
            (lambda: client.notify("SCAN", dict(scan, id=2**64)), "SCAN: id: an integer is none of 64 bits"),
            (lambda: client.notify_binary("X", 5), "no bytes of this int: .* right are bytes, or a text"),
            (lambda: client.register("X", rate=-1), "the rate of X is -1; right is how many messages a second at most"),
            (lambda: client.register(""), r"registered for '' and '': right is register\(name"),
            (lambda: client.wait_until_connected(math.nan), r"wait_until_connected\(nan\): right is a time from 0"),
            (lambda: client.add_active_queue("queue", None), "'queue' that calls None: right is a text, and a function"),
            (lambda: client.set_on_mail_callback(5), r"set_on_mail_callback\(5\): right is a function without arguments"),
            (lambda: elk.comms().run(self.community, "x" * 10**6), "x… is no name for a client: it has 1000000 bytes"),
            (lambda: elk.listen(self.community, "it", "NAV_*"), r"right is a list of variables, as \['NAV_\*'\]"),
            (lambda: elk.Log("\ud800"), "is no path: .* right is a text that the system's files can have"),
            (lambda: elk.Mission("car\0").check(), "is no path; right is a text, without a zero in it"),
            (lambda: elk.Mission("--version").check(), "./--version"),
        ]:
            with self.assertRaisesRegex(elk.Error, words):
                wrong()

    def test_a_period_that_is_none_is_refused(self):
        for period in (math.nan, math.inf, 0, -1, 5e-324, 1e300, 10**400):
            app = elk.App("app", self.community)
            app.period = period
            with self.assertRaisesRegex(elk.Error, "(period of app is .*; right is the time between two calls|too large)"):
                app.run()

    def test_names_and_texts_of_others_rule_no_terminal(self):
        reader = self.client("reader", ["*"])
        self.writer.notify("WORDS", "\x1b[2J\u202e" + "x" * 10_000, aux_src="\x1b[31m")
        message = self.hear(reader, "WORDS")
        for shown in (repr(message), str(message)):
            self.assertTrue(shown.isprintable(), shown)
            self.assertLess(len(shown), 2000)

    def test_a_number_where_a_text_was_awaited_is_a_rejection(self):
        reader = self.client("reader", ["WORDS"])
        self.writer.notify("WORDS", 1)
        message = self.hear(reader, "WORDS")
        with self.assertRaises(elk.Rejection) as told:
            message.string()
        self.assertIsInstance(told.exception, elk.Error)
        self.assertIsInstance(told.exception, elk.DecodeError)

"""Whoever comes from pymoos (2022.1, the last one) finds the same here, and else is told why not and what is right."""

import contextlib
import inspect
import io
import re
import tempfile
import threading
from pathlib import Path

import elk
from bus import PATIENCE, OnABus, eventually, news
from elk._comms import NOT_HERE

#: pymoos' comms: names, and what may be said by name.
COMMS = {
    "add_active_queue": "queue_name func",
    "add_message_route_to_active_queue": "queue_name msg_name",
    "close": "nice",
    "do_local_time_correction": "",
    "enable_comms_status_monitoring": "enable",
    "fetch": "",
    "get_client_comms_status": "client status",
    "get_client_comms_statuses": "statuses",
    "get_comms_control_timewarp_scale_factor": "",
    "get_community_name": "",
    "get_description": "",
    "get_moos_name": "",
    "get_number_bytes_read": "",
    "get_number_bytes_sent": "",
    "get_number_message_read": "",
    "get_number_messages_sent": "",
    "get_number_of_unread_messages": "",
    "get_number_of_unsent_messages": "",
    "get_published": "",
    "get_registered": "",
    "has_active_queue": "queue_name",
    "is_asynchronous": "",
    "is_connected": "",
    "is_registered_for": "",
    "is_running": "",
    "notify": "name value aux_src time",
    "notify_binary": "name binary_data time",
    "print_message_to_active_queue_routing": "",
    "register": "name interval var_pattern app_pattern",
    "remove_active_queue": "queue_name",
    "remove_message_route_to_active_queue": "queue_name msg_name",
    "run": "name",
    "set_comms_control_timewarp_scale_factor": "scale_factor",
    "set_comms_tick": "comms_tick",
    "set_on_connect_callback": "func",
    "set_on_mail_callback": "func",
    "set_quiet": "",
    "set_verbose_debug": "",
    "wait_until_connected": "n_ms",
}
#: pymoos' moos_msg.
MESSAGE = """binary_data binary_data_size community double double_aux is_binary is_double is_name is_string key mark_as_binary name
    source source_aux string time trace""".split()
#: What else pymoos has.
MODULE = """base_async_comms base_comms_object base_sync_comms comms get_moos_timewarp is_little_end_in local_time moos_comms_status
    moos_comms_status_list moos_msg moos_msg_list pyMOOSException set_moos_timewarp time""".split()
#: What is not in the module, as docs/python.md says.
NOT_IN_MODULE = """base_async_comms base_comms_object base_sync_comms is_little_end_in moos_comms_status moos_comms_status_list
    moos_msg moos_msg_list pyMOOSException""".split()
GUIDE = (Path(__file__).resolve().parents[3] / "docs/python.md").read_text()


class Names(OnABus):
    def test_every_name_is_here_or_is_documented_as_not_here(self):
        self.assertEqual(set(COMMS) - set(dir(elk.comms)), set(NOT_HERE))
        self.assertEqual(set(MESSAGE) - set(dir(elk.Message)), {"double_aux"})
        self.assertEqual(set(MODULE) - set(dir(elk)), set(NOT_IN_MODULE))
        rows = "\n".join(line for line in GUIDE.splitlines() if "not here" in line)
        for name in [*NOT_HERE, "double_aux", *NOT_IN_MODULE]:
            self.assertIn(f"`{name}`", rows)

    def test_words_have_pymoos_names(self):
        for name, words in COMMS.items():
            if name not in NOT_HERE:
                self.assertLessEqual(set(words.split()), set(inspect.signature(getattr(elk.comms, name)).parameters), name)

    def test_what_is_not_here_says_why(self):
        for name, why in NOT_HERE.items():
            with self.assertRaisesRegex(AttributeError, f"no attribute '{name}': {re.escape(why)}"):
                getattr(elk.comms(), name)
        with self.assertRaisesRegex(AttributeError, "'comms' object has no attribute 'fetsch'$"):
            elk.comms().fetsch()


class Messages(OnABus):
    def test_notify_has_its_forms(self):
        reader, writer = self.client("reader", ["A_*"]), self.client("writer")
        writer.notify("A_TIME", 1.0, 12.5)
        writer.notify("A_AUX", 2.0, "aux", 13.5)
        writer.notify("A_TEXT", "said", "aux")
        writer.notify(name="A_NAMED", value="said", aux_src="by name", time=14.5)
        before = elk.time()
        writer.notify("A_NOW", 3.0, -1)
        writer.notify_binary("A_BYTES", "a text's", 15.5)
        heard = {one.key(): one for one in self.hear_all(reader, 6)}
        says = lambda key: (heard[key].value(), heard[key].source_aux(), heard[key].time())
        self.assertEqual(says("A_TIME"), (1.0, "", 12.5))
        self.assertEqual(says("A_AUX"), (2.0, "aux", 13.5))
        self.assertEqual(says("A_TEXT")[:2], ("said", "aux"))
        self.assertEqual(says("A_NAMED"), ("said", "by name", 14.5))
        self.assertTrue(before <= heard["A_NOW"].time() <= elk.time())
        self.assertGreater(heard["A_TEXT"].time(), 1e9, "that is now")
        self.assertEqual((bytes(heard["A_BYTES"].binary_data()), heard["A_BYTES"].time()), (b"a text's", 15.5))
        for wrong in [(1.0, 2.0), ("aux", "aux"), (1.0, "aux"), ("aux", 1.0, 2.0)]:
            with self.assertRaisesRegex(elk.Error, r"right is notify\(name, value, time=-1.0\) or notify\(name, value, aux_src"):
                writer.notify("A_TIME", 1.0, *wrong)
        with self.assertRaisesRegex(elk.Error, "each said once"):
            writer.notify("A_TIME", 1.0, 2.0, time=3.0)

    def hear_all(self, client, count):
        heard = []
        eventually(lambda: heard.extend(client.fetch()) or len(heard) == count, f"{count} messages")
        return heard

    def test_register_has_its_forms(self):
        client = self.client("client")
        client.register("A", interval=0.5)
        client.register("B", 0.25)
        client.register("C_*", "gps", 2)
        client.register(var_pattern="D_?", app_pattern="gps", interval=0.0)
        client.register("E", "gps", rate=10)
        client.register("F", 1e-12)
        client.notify("G", 1)
        self.assertEqual(client.get_registered(), {"A", "B", "C_*", "D_?", "E", "F"})
        for name, is_heard in {"A": True, "C_": True, "C_1": True, "D_1": True, "D_12": False, "a": False, "G": False}.items():
            self.assertEqual(client.is_registered_for(name), is_heard, name)
        client.unregister("C_*", "gps")
        self.assertFalse(client.is_registered_for("C_1"))
        self.assertEqual(client.get_published(), {"G"})
        for wrong, words in [
            (lambda: client.register("A", -1), "the interval of A is -1; right is the least time between two messages"),
            (lambda: client.register("A", float("nan")), "the interval of A is nan"),
            (lambda: client.register("A", 1, rate=10), "A has an interval of 1 s and a rate of 10; right is one of them"),
            (lambda: client.register("A", 1, "gps"), r"right is register\(name, interval=0.0\) or register\(var_pattern"),
            (lambda: client.register("A", 1, interval=2), "each said once"),
            (lambda: client.register("A", var_pattern="B"), r"registered for 'A' and 'B': right is register\(name"),
            (lambda: client.register(""), "registered for '' and ''"),
        ]:
            with self.assertRaisesRegex(elk.Error, words):
                wrong()

    def test_an_interval_thins_out_what_is_heard(self):
        seldom = elk.comms()
        seldom.set_on_connect_callback(lambda: seldom.register("N", interval=1e6) and seldom.register("END"))
        seldom.set_on_mail_callback(news)
        seldom.run(self.community, "seldom")
        self.addCleanup(seldom.close)
        self.assertTrue(seldom.wait_until_connected(PATIENCE * 1000))
        writer = self.client("writer")
        for number in range(100):
            writer.notify("N", number)
        writer.notify("END", 1)
        heard = []
        eventually(lambda: heard.extend(seldom.fetch()) or any(one.is_name("END") for one in heard), "the end")
        self.assertEqual(sum(one.is_name("N") for one in heard), 1)

    def test_messages_are_as_pymoos_has_them(self):
        reader, writer = self.client("reader", ["A_*"]), self.client("writer")
        writer.notify("A_TEXT", "grüß", "aux", 2.5)
        writer.notify("A_NUMBER", 1.5)
        text, number = self.hear_all(reader, 2)
        self.assertEqual((bytes(text.binary_data()), text.binary_data_size(), text.is_binary()), ("grüß".encode(), 0, False))
        text.mark_as_binary()
        self.assertEqual((text.binary_data_size(), text.is_binary(), text.is_string(), text.string()), (6, True, True, "grüß"))
        for wrong in [number.mark_as_binary, number.binary_data]:
            with self.assertRaisesRegex(elk.Error, "A_NUMBER carries number, and no"):
                wrong()
        with self.assertRaisesRegex(AttributeError, "'double_aux': a value has no second number here"):
            number.double_aux()
        with contextlib.redirect_stdout(io.StringIO()) as out:
            text.trace()
        self.assertEqual(out.getvalue(), f'A_TEXT="grüß" from writer (aux) of {self.community} at 2.500 s\n')


class Client(OnABus):
    def test_a_client_tells_of_itself(self):
        client = elk.comms()
        self.assertEqual((client.get_community_name(), client.get_moos_name(), client.get_description()), ("", "", "not running"))
        self.assertEqual((client.get_number_messages_sent(), client.get_number_of_unread_messages()), (0, 0))
        for unsaid in [lambda: client.notify("A", 1), lambda: client.register("A"), lambda: client.unregister("A")]:
            with self.assertRaisesRegex(elk.Error, "nothing is running; right is run"):
                unsaid()
        client, writer = self.client("client", ["A_*"]), self.client("writer")
        self.assertEqual((client.get_community_name(), client.get_moos_name()), (self.community, "client"))
        self.assertEqual(client.get_description(), f"client in community {self.community}, over shared memory")
        self.assertTrue(client.is_asynchronous())
        writer.notify("A_NUMBER", 1)
        writer.notify("A_TEXT", "grüß")
        writer.notify_binary("A_BYTES", b"123")
        eventually(lambda: client.get_number_of_unread_messages() == 3, "the mail")
        self.assertEqual((client.get_number_message_read(), client.get_number_bytes_read()), (3, 8 + 6 + 3))
        self.assertEqual((writer.get_number_messages_sent(), writer.get_number_bytes_sent()), (3, 8 + 6 + 3))
        self.assertEqual((writer.get_number_of_unsent_messages(), client.get_number_messages_sent()), (0, 0))
        client.fetch()
        self.assertEqual(client.get_number_of_unread_messages(), 0)
        client.close()
        self.assertEqual((client.get_community_name(), client.get_moos_name()), ("", "client"))

    def test_what_is_not_said_yet_is_counted(self):
        client, may_go, is_in = self.client("client", ["A"]), threading.Event(), threading.Event()
        self.addCleanup(may_go.set)
        client.set_on_mail_callback(lambda: is_in.set() or may_go.wait(PATIENCE))
        self.client("writer").notify("A", 1)
        self.assertTrue(is_in.wait(PATIENCE))
        client.register("B")
        client.notify("A", 2)
        client.notify("A", 3)
        self.assertEqual((client.get_number_of_unsent_messages(), client.get_number_messages_sent()), (2, 0))
        client.set_on_mail_callback(news)
        may_go.set()
        eventually(lambda: client.get_number_messages_sent() == 2, "what waited")
        self.assertEqual(client.get_number_of_unsent_messages(), 0)

    def test_a_variable_goes_to_several_queues_until_it_is_routed_no_longer(self):
        reader, routed = self.client("reader", ["X", "END"]), []
        hear = lambda name: lambda message: routed.append((name, message.value())) or news()
        for name in "one", "two":
            reader.add_active_queue(queue_name=name, func=hear(name))
            reader.add_message_route_to_active_queue(queue_name=name, msg_name="X")
        reader.add_message_route_to_active_queue("two", "END")
        with contextlib.redirect_stdout(io.StringIO()) as out:
            reader.print_message_to_active_queue_routing()
        self.assertEqual(out.getvalue(), "END -> two\nX -> one, two\n")
        writer = self.client("writer")
        writer.notify("X", 1)
        eventually(lambda: sorted(routed) == [("one", 1.0), ("two", 1.0)], "both")
        self.assertTrue(reader.remove_message_route_to_active_queue("one", "X"))
        self.assertFalse(reader.remove_message_route_to_active_queue("one", "X"))
        writer.notify("X", 2)
        eventually(lambda: ("two", 2.0) in routed, "the other")
        self.assertTrue(reader.remove_message_route_to_active_queue("two", "X"))
        writer.notify("X", 3)
        self.assertEqual(self.hear(reader, "X").value(), 3.0)
        writer.notify("END", 4)
        eventually(lambda: ("two", 4.0) in routed, "the end")
        self.assertEqual(sorted(routed), [("one", 1.0), ("two", 1.0), ("two", 2.0), ("two", 4.0)])

    def test_it_is_quiet_and_silent_unless_it_is_told(self):
        script = """
            import os, sys, elk
            client = elk.comms()
            client.set_quiet(sys.argv[1] == "quiet")
            client.set_verbose_debug(sys.argv[1] == "verbose")
            client.set_on_connect_callback(lambda: client.register("A") and client.notify("A", 1))
            client.run(os.environ["ELK_COMMUNITY"], "app")
            assert client.wait_until_connected(60_000)
            while not client.fetch():
                pass
            client.close()
        """
        said = {}
        for how in "quiet", "loud", "verbose":
            app = self.python(script, how)
            out, said[how] = app.communicate(timeout=PATIENCE)
            self.assertEqual((app.returncode, out), (0, ""), said[how])
        life = [f"app {what} {self.community}" for what in ("looks for the broker of", "has joined", "leaves")]
        self.assertEqual(said["quiet"], "")
        self.assertEqual(said["loud"].splitlines(), life)
        for words in [*life, "app registers for A of *", "app says A=1", "app hears <elk.Message A=1 from app at "]:
            self.assertIn(words, said["verbose"])


class Time(OnABus):
    BROKER = ["--time-warp", "10"]

    def test_the_module_has_the_community_s_time(self):
        script = """
            import os, time, elk

            def between(function, warp):
                before, now, after = time.time() * warp, function(), time.time() * warp
                assert before - 0.01 <= now <= after + 0.01, (before, now, after)

            assert elk.get_moos_timewarp() == 1 and not elk.set_moos_timewarp(-2.0) and not elk.set_moos_timewarp(0)
            assert elk.set_moos_timewarp(2.0) and elk.get_moos_timewarp() == 2
            for warp in 2, 10:
                if warp == 10:  # what the broker says
                    client = elk.comms()
                    client.run(os.environ["ELK_COMMUNITY"], "app")
                    assert client.wait_until_connected(60_000)
                    assert elk.set_moos_timewarp(10) and not elk.set_moos_timewarp(3)
                    assert elk.get_moos_timewarp() == 10
                for function in elk.time, elk.local_time:
                    between(function, warp)
                    between(lambda: function(apply_timewarping=False), 1)
            client.close()
            print("as it should be")
        """
        app = self.python(script)
        out, err = app.communicate(timeout=PATIENCE)
        self.assertEqual((app.returncode, out), (0, "as it should be\n"), err)

    def test_a_player_of_logs_drives_the_community_s_time(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        log = Path(folder.name) / "recorded.alog"
        log.write_text("%% LOGSTART 1000\n0.0 A writer 1\n0.1 A writer 2\n0.2 END writer 3\n")
        times, client = {}, elk.comms()

        def on_mail():
            for message in client.fetch():
                times[message.key()] = elk.time(), elk.local_time()
            news()

        client.set_on_connect_callback(lambda: client.register("A") and client.register("END"))
        client.set_on_mail_callback(on_mail)
        client.run(self.community, "client")
        self.addCleanup(client.close)
        self.assertTrue(client.wait_until_connected(PATIENCE * 1000))
        self.elk("replay", str(log), "--community", self.community, "--clock")
        eventually(lambda: "END" in times, "the recording")
        # A client reckons on between two words of the player, and a word that comes late sets its clock back.
        self.assertTrue(all(1000 <= time < 1e6 for time, _ in times.values()), times)
        self.assertGreater(times["END"][1], 1e9)

"""Callbacks and processes that do what nobody meant: no crash, no hang, and whoever uses the client is told."""

import os
import signal
import threading

import elk
from bus import PATIENCE, OnABus, eventually

CLIENT = """
    import os, sys, threading, time
    import elk

    # What the one before has said is none of its business.
    GO = f"GO_{os.getpid()}"

    def join(name, on_mail=None, *variables):
        client = elk.comms()
        client.set_on_connect_callback(lambda: [client.register(one) for one in variables])
        client.set_on_mail_callback(on_mail)
        client.run(os.environ["ELK_COMMUNITY"], name)
        assert client.wait_until_connected(60_000)
        return client
"""


class Clients(OnABus):
    def setUp(self):
        super().setUp()
        self.watcher = self.client("watcher", ["SAID", "DB_CLIENTS", "READY"])

    def run_to_end(self, script, code=0):
        process = self.python(CLIENT + script)
        out, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, code, err)
        return out, err

    def test_a_fork_says_nothing_in_its_parent_s_name_and_has_clients_of_its_own(self):
        out, _ = self.run_to_end("""
    client = join("parent", None, "*")
    held = []
    while not held:
        client.notify_binary("BIG", bytes(100_000))
        held = [one.binary_data() for one in client.fetch() if one.key() == "BIG"]
    child = os.fork()
    if child == 0:
        for use in [lambda: client.notify("SAID", "by the fork"), client.fetch, lambda: client.register("X"), lambda: client.describe("X")]:
            try:
                print("it could")
            except elk.Error as refusal:
                assert f"parent is a client of process {os.getppid()}, and this is a fork of it" in str(refusal), refusal
        assert not client.is_running() and client.get_number_of_unread_messages() == 0
        del held
        client.close()
        own = join("child")
        own.notify("SAID", "by a client of the fork")
        own.close()
        sys.exit(7)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    client.notify("SAID", "by the parent")
    client.close()
""".replace('print("it could")', "use()\n                raise SystemExit(9)"))
        said = [message.string() for message in self.hear(self.watcher, "SAID", 2)]
        self.assertEqual((out, said), ("", ["by a client of the fork", "by the parent"]))

    def test_a_fork_that_comes_back_from_a_callback_ends_there_and_its_parent_goes_on(self):
        for ending, code, words in [
            ("pass", 1, "a fork, process .*, has come back from on_new_mail"),
            ("raise ValueError('no')", 1, "ValueError: no"),
            ("sys.exit(5)", 5, "^$"),
            ("os._exit(6)", 6, "^$"),
            ("client.notify('SAID', 'by the fork')", 1, "this is a fork of it"),
        ]:
            _, err = self.run_to_end(f"""
    done, codes = threading.Event(), []
    def on_mail():
        child = os.fork()
        if child == 0:
            {ending}
            return
        codes.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
        done.set()
    client = join("parent", on_mail, GO)
    client.notify(GO, 1)
    assert done.wait(60)
    assert codes == [{code}] and client.is_running(), codes
    client.notify("SAID", "by the parent")
    client.close()
""")
            self.assertRegex(err, words)
            self.assertEqual(self.hear(self.watcher, "SAID").string(), "by the parent")

    def test_the_broker_hears_of_a_death_though_a_fork_lives(self):
        mortal = self.python(CLIENT + """
    client = join("mortal")
    child = os.fork()
    if child == 0:
        time.sleep(1000)
    client.notify("READY", child)
    time.sleep(1000)
""")
        child = int(self.hear(self.watcher, "READY").value())
        self.addCleanup(os.kill, child, signal.SIGKILL)
        mortal.kill()
        mortal.wait()

        def is_gone():
            clients = [one.string() for one in self.watcher.fetch() if one.key() == "DB_CLIENTS"]
            return clients and "mortal" not in clients[-1]

        eventually(is_gone, "the word that it is gone")

    def test_whatever_a_callback_does_the_process_ends_in_good_order(self):
        for does, words in [
            ("sys.exit(3)", r"has ended: .* raised SystemExit.*3"),
            ("raise KeyboardInterrupt", r"has ended: .* raised KeyboardInterrupt"),
            ("raise Raising()", "raised Raising: "),
            ("raise ValueError('\\ud800' * 3)", "raised ValueError: "),
            ("raise ValueError('x' * 10**7)", "raised ValueError: xxx"),
            ("recurse()", "raised RecursionError"),
            ("client.run('a', 'b')", "is running already"),
            ("raise elk.Rejection('x' * 10**7)", None),
            ("message.string()", None),
            ("client.close()", None),
            ("[client.notify('OTHER', 1) for _ in range(1000)]", None),
        ]:
            for is_queue in (False, True):
                out, _ = self.run_to_end(f"""
    class Raising(Exception):
        def __str__(self):
            raise ValueError("no words")

    def recurse():
        recurse()

    called = threading.Event()
    def act(*messages):
        message = messages[0] if messages else client.fetch()[0]
        called.set()
        {does}

    client = elk.comms()
    client.set_on_connect_callback(lambda: client.register(GO))
    if {is_queue}:
        client.add_active_queue("queue", act)
        client.add_message_route_to_active_queue("queue", GO)
    else:
        client.set_on_mail_callback(act)
    client.run(os.environ["ELK_COMMUNITY"], "client")
    assert client.wait_until_connected(60_000)
    client.notify(GO, 1)
    assert called.wait(60)
    if {words is None}:
        assert client.fetch() == [] and client.close()
    else:
        client._thread.join(60)
        try:
            client.fetch()
        except elk.Error as told:
            print(str(told))
""")
                self.assertLess(len(out), 2000, does)
                if words is not None:
                    self.assertRegex(out, words)

    def test_a_message_that_an_active_queue_cannot_use_is_said_and_the_next_one_taken(self):
        judge = self.client("judge", ["MAIL_REJECTED"])
        client, taken = self.client("client", ["SPEED"]), threading.Event()
        client.add_active_queue("queue", lambda message: message.double() < 2 and message.string() or taken.set())
        client.add_message_route_to_active_queue("queue", "SPEED")
        self.watcher.notify("SPEED", 1.5)
        words = self.hear(judge, "MAIL_REJECTED").string()
        self.assertRegex(words, r"^client rejects SPEED #\d+ by watcher: SPEED carries number, and no text; right is value\(\)")
        self.watcher.notify("SPEED", 2.5)
        self.assertTrue(taken.wait(PATIENCE))

    def test_a_callback_that_does_not_end_keeps_no_process(self):
        for does, code in [
            ("while True: time.sleep(0.001)", 0),
            ("while True: pass", 0),
            ("time.sleep(1000)", 0),
            ("threading.Event().wait()", 0),
            ("stubborn()", 1),
        ]:
            for is_queue in (False, True):
                out, err = self.run_to_end(
                    f"""
    elk._comms.PATIENCE = elk._comms.QUEUE_PATIENCE = 0.5
    entered = threading.Event()
    def stubborn():
        while True:
            try:
                time.sleep(0.001)
            except BaseException:
                pass

    def block(*_):
        entered.set()
        {does}

    client = elk.comms()
    client.set_on_connect_callback(lambda: client.register(GO))
    if {is_queue}:
        client.add_active_queue("queue", block)
        client.add_message_route_to_active_queue("queue", GO)
    else:
        client.set_on_mail_callback(block)
    client.run(os.environ["ELK_COMMUNITY"], "client")
    client.notify(GO, 1)
    assert entered.wait(60)
    print(client.close())
""",
                    code,
                )
                self.assertEqual(out, "False\n")
                self.assertEqual("is left behind" in err, "True" not in does, err)

    def test_threads_that_say_something_while_the_client_is_closed_are_told(self):
        for number in range(3):
            client, told = self.client(f"closing{number}", ["MINE"]), []

            def say(value):
                try:
                    while True:
                        client.notify("MINE", value)
                except elk.Error as refusal:
                    told.append(str(refusal))

            values = [1.0, "text" * 10_000, b"bytes" * 10_000] * 2
            threads = [threading.Thread(target=say, args=(value,)) for value in values]
            [thread.start() for thread in threads]
            eventually(client.get_number_message_read, "the first of what they say")
            closing = [threading.Thread(target=client.close) for _ in range(3)]
            [thread.start() for thread in closing]
            [thread.join(PATIENCE) for thread in threads + closing]
            self.assertEqual(told, [f"closing{number} was stopped; nothing is said any more"] * 6)

    def test_who_does_not_fetch_takes_no_more_than_its_bound(self):
        elk._queues.MOST_BYTES, before = 10 << 20, elk._queues.MOST_BYTES
        self.addCleanup(setattr, elk._queues, "MOST_BYTES", before)
        client, text, done = self.client("client"), "x" * 1_000_000, threading.Event()
        # The one comes behind the other.
        client.add_active_queue("last", lambda message: message.double() < 2 or done.set())
        client.add_message_route_to_active_queue("last", "LAST")
        client.register("LONG", lossless=True)
        client.register("LAST", lossless=True)
        self.watcher.notify("LONG", "first")
        self.watcher.notify("LAST", 1)
        eventually(client.fetch, "the registration, which may take longer than all that follows")
        [self.watcher.notify("LONG", text) for _ in range(40)]
        self.watcher.notify("LAST", 2)
        self.assertTrue(done.wait(PATIENCE))
        kept = client.fetch()
        self.assertEqual(len(kept) + client.lost(), 40)
        self.assertEqual(sum(len(one.string()) for one in kept) // 1_000_000, 10)

    def test_a_broker_that_dies_in_the_midst_of_much_takes_nobody_along(self):
        client, heard = self.client("client", ["N"]), []
        client.set_on_mail_callback(lambda: heard.extend(one.value() for one in client.fetch()))
        stop = threading.Event()

        def say():
            number = 0
            while not stop.is_set():
                number += 1
                client.notify("N", number)
                client.notify_binary("BIG", bytes(50_000))

        thread = threading.Thread(target=say)
        thread.start()
        for _ in range(3):
            self.broker.kill()
            self.broker.wait()
            self.start_broker()
            before = len(heard)
            # What it says comes back to it.
            self.client(f"witness{before}", ["BIG"]).set_on_mail_callback(None)
            while len(heard) <= before:
                self.assertTrue(client.is_running())
        stop.set()
        thread.join(PATIENCE)
        self.assertFalse(thread.is_alive())

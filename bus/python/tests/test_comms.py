"""pymoos' names: `elk.comms()`."""

import threading

import elk
from bus import PATIENCE, OnABus, eventually, news


class Comms(OnABus):
    def test_numbers_texts_and_bytes_are_heard_as_they_were_said(self):
        reader, writer = self.client("reader", ["A_*"]), self.client("writer")
        writer.notify("A_NUMBER", 1.5)
        writer.notify("A_COUNT", 7, 12.25)
        writer.notify("A_TEXT", "grüß\ngott", aux_src="by hand")
        writer.notify_binary("A_BYTES", b"\0\1\xff")
        eventually(lambda: len(reader._waiting.messages.queue) == 4, "the mail")
        number, count, text, data = reader.fetch()
        self.assertEqual((number.key(), number.double(), number.value(), number.source()), ("A_NUMBER", 1.5, 1.5, "writer"))
        self.assertEqual((count.double(), count.time(), count.is_double()), (7.0, 12.25, True))
        self.assertEqual((text.string(), text.source_aux(), text.is_string()), ("grüß\ngott", "by hand", True))
        self.assertEqual((bytes(data.binary_data()), data.binary_data_size(), data.is_binary()), (b"\0\1\xff", 3, True))
        self.assertTrue(data.binary_data().readonly)
        # Its status, which it says of itself, counts as well.
        numbers = [one.sequence() for one in (number, count, text, data)]
        self.assertEqual(numbers, sorted(set(numbers)))
        with self.assertRaisesRegex(elk.Error, "A_TEXT carries text, and no number; right is value"):
            text.double()

    def test_the_latest_value_comes_at_once_and_says_so(self):
        self.client("writer").notify("SPEED", 2.0)
        self.elk("poke", "--community", self.community, "OTHER", "1")
        reader = self.client("reader", ["SPEED"])
        message = self.hear(reader, "SPEED")
        self.assertEqual((message.value(), message.is_latest()), (2.0, True))

    def test_on_mail_and_active_queues_divide_the_mail(self):
        reader, fetched, routed, threads = elk.comms(), [], [], set()
        reader.set_on_connect_callback(lambda: reader.register("*_X", 0) and reader.register("Y", 0))

        def on_mail():
            fetched.extend(message.key() for message in reader.fetch())
            news()
            return True

        def on_routed(message):
            routed.append(message.value())
            threads.add(threading.current_thread().name)
            news()
            return True

        reader.set_on_mail_callback(on_mail)
        reader.add_active_queue("fast", on_routed)
        reader.add_message_route_to_active_queue("fast", "NAV_X")
        reader.run(self.community, "reader")
        self.addCleanup(reader.close)
        self.assertTrue(reader.wait_until_connected(PATIENCE * 1000))
        writer = self.client("writer")
        for count in range(100):
            writer.notify("NAV_X", count)
            writer.notify("Y", count)
        eventually(lambda: len(routed) == 100 and len(fetched) == 100, "all mail")
        self.assertEqual((routed, set(fetched), threads), ([float(n) for n in range(100)], {"Y"}, {"fast"}))
        self.assertTrue(reader.remove_active_queue("fast"))
        writer.notify("NAV_X", 1)
        eventually(lambda: "NAV_X" in fetched, "what is routed no longer")
        with self.assertRaisesRegex(elk.Error, "no active queue slow; add_active_queue makes one"):
            reader.add_message_route_to_active_queue("slow", "NAV_X")

    def test_many_threads_say_all_they_have_to(self):
        reader, writer, heard = self.client("reader"), self.client("writer"), []
        reader.register("N", lossless=True)
        reader.set_on_mail_callback(lambda: heard.extend(one.value() for one in reader.fetch()) or news())
        writer.notify("N", -1)
        eventually(lambda: heard == [-1.0], "the registration, which may take longer than all that follows")
        say = lambda start: [writer.notify("N", start + n) for n in range(2000)]
        threads = [threading.Thread(target=say, args=(10_000 * n,)) for n in range(4)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        eventually(lambda: len(heard) >= 8001, "what four threads said")
        self.assertEqual(sorted(heard), [-1.0, *(float(10_000 * n + i) for n in range(4) for i in range(2000))])
        self.assertEqual(reader.lost(), 0)

    def test_a_callback_s_exception_ends_the_client_and_who_uses_it_is_told(self):
        reader, raised = self.client("reader", ["SPEED"]), []
        threading.excepthook, before = lambda args: raised.append(args), threading.excepthook
        self.addCleanup(setattr, threading, "excepthook", before)
        reader.set_on_mail_callback(lambda: 1 // 0)
        self.client("writer").notify("SPEED", 1)
        reader._thread.join(PATIENCE)
        self.assertFalse(reader.is_running())
        reader.fetch()
        with self.assertRaisesRegex(elk.Error, r"reader has ended: reader: on_new_mail\(SPEED\) raised ZeroDivisionError") as told:
            reader.fetch()
        self.assertIsInstance(told.exception.__cause__.__cause__, ZeroDivisionError)
        self.assertEqual(raised[0].thread.name, "reader")
        with self.assertRaisesRegex(elk.Error, "reader ended: .* nothing is said any more"):
            reader.notify("SPEED", 2)

    def test_it_waits_for_a_broker_and_survives_its_death(self):
        self.end(self.broker)
        client = elk.comms()
        client.set_on_connect_callback(lambda: client.register("SPEED"))
        client.set_on_mail_callback(news)
        client.run(self.community, "early")
        self.addCleanup(client.close)
        self.assertFalse(client.is_connected())
        self.start_broker()
        self.assertTrue(client.wait_until_connected(PATIENCE * 1000))
        self.broker.kill()
        self.broker.wait()
        self.start_broker()
        self.addCleanup(client.close)
        self.client("writer").notify("SPEED", 3)
        self.assertEqual(self.hear(client, "SPEED").value(), 3.0, "it is there again, and registered")

    def test_what_cannot_be_is_said_with_what_would_be_right(self):
        client = self.client("client")
        for wrong, words in [
            (lambda: client.notify("A*", 1), "is no variable's name"),
            (lambda: client.notify("DB_TIME", 1), "DB_TIME is the broker's own"),
            (lambda: client.notify("A", object()), "a object is no value for the bus"),
            (lambda: client.notify("A", {"x": 1}), "nobody has written A or reads it"),
            (lambda: client.notify("A", 1, type="Pose9"), "writes or reads a type Pose9"),
            (lambda: client.notify("A" * 300, 1), "is a name of 300 bytes; at most 256"),
            (lambda: client.register("A", rate=0), "the rate of A is 0; right is how many messages a second"),
            (lambda: client.run("other", "client"), "client is running already"),
            (lambda: elk.comms().run("localhost", 9000, "x"), r"right is run\(community, name\)"),
            (lambda: elk.comms().fetch(), "nothing is running; right is run"),
        ]:
            with self.assertRaisesRegex(elk.Error, words):
                wrong()
        twin = elk.comms()
        endless = [0]
        endless.append(endless)
        with self.assertRaisesRegex(elk.Error, "more than 64 deep"):
            client.notify("A", endless)
        with self.assertRaisesRegex(elk.Error, "a/b.*is no name for a community"):
            twin.run("a/b", "x")

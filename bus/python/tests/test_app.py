"""`elk.App`: callbacks, signals, failures; and what happens at an interpreter's end."""

import asyncio
import signal

import elk
from bus import PATIENCE, OnABus

ECHO = """
    import elk

    class Echo(elk.App):
        period = 0.01
        ticks = 0

        def on_start_up(self):
            self.register("SAID")
            self.notify("STARTED", self.parameter("greeting", "none"))

        def on_new_mail(self, message):
            if message.value() == "reject":
                raise elk.Rejection("I do not like it")
            if message.value() == "fail":
                raise ValueError("no such thing")
            if message.value() == "stop":
                self.stop()
            self.notify("ECHO", message.value())

        def iterate(self):
            self.ticks += 1
            self.notify("TICKS", self.ticks)

        def on_stop(self):
            self.notify("STOPPED", self.ticks)

    Echo().run()
    print("left")
"""


class App(OnABus):
    def setUp(self):
        super().setUp()
        self.watcher = self.client("watcher", ["STARTED", "ECHO", "TICKS", "STOPPED", "MAIL_REJECTED", "APP_STATUS"])

    def start(self, *arguments):
        app = self.python(ECHO, *arguments)
        self.hear(self.watcher, "STARTED")
        return app

    def test_an_app_hears_its_mail_ticks_and_leaves_when_it_stops_itself(self):
        app = self.python(ECHO, "Greeting=hello")
        self.assertEqual(self.hear(self.watcher, "STARTED").value(), "hello")
        self.assertIn("MOOSName=app", self.hear(self.watcher, "APP_STATUS").value())
        self.hear(self.watcher, "TICKS", 3)
        self.watcher.notify("SAID", "stop")
        self.assertEqual(self.hear(self.watcher, "ECHO").value(), "stop")
        out, err = app.communicate(timeout=PATIENCE)
        self.assertEqual((app.returncode, out, err), (0, "left\n", ""))

    def test_a_message_that_it_rejects_is_counted_and_the_next_one_taken(self):
        self.start()
        self.watcher.notify("SAID", "reject")
        self.assertIn("I do not like it", str(self.hear(self.watcher, "MAIL_REJECTED").value()))
        self.watcher.notify("SAID", "next")
        self.assertEqual(self.hear(self.watcher, "ECHO").value(), "next")

    def test_an_exception_ends_it_with_its_traceback_and_name(self):
        app = self.start()
        self.watcher.notify("SAID", "fail")
        out, err = app.communicate(timeout=PATIENCE)
        self.assertEqual((app.returncode, out), (1, ""))
        self.assertRegex(err, r"Traceback .*\n  File .* in on_new_mail\nValueError: no such thing\n")
        self.assertTrue(err.endswith("app: on_new_mail(SAID) raised ValueError: no such thing\n"), err)

    def test_signals_have_it_leave_in_good_order(self):
        for number, code in [(signal.SIGTERM, 0), (signal.SIGINT, -signal.SIGINT)]:
            app = self.start()
            app.send_signal(number)
            self.hear(self.watcher, "STOPPED")
            out, err = app.communicate(timeout=PATIENCE)
            self.assertEqual(app.returncode, code, err)
            self.assertEqual(("KeyboardInterrupt" in err, out == "left\n"), (code != 0, code == 0), err)

    def test_without_a_broker_it_says_how_to_start_one(self):
        self.watcher.close()
        self.end(self.broker)
        app = self.python(ECHO)
        _, err = app.communicate(timeout=PATIENCE)
        self.assertEqual(app.returncode, 1)
        self.assertRegex(err, "no broker serves community .* start one with `elk db")

    def test_nobody_is_left_hanging_at_the_interpreter_s_end(self):
        for ending in ["pass", "raise SystemExit(3)", "1 // 0", "import time; time.sleep(1000)"]:
            script = f"""
                import os, elk
                client = elk.comms()
                client.set_on_connect_callback(lambda: client.register("*"))
                client.add_active_queue("mine", lambda message: None)
                client.add_message_route_to_active_queue("mine", "STARTED")
                client.run(os.environ["ELK_COMMUNITY"], "app")
                assert client.wait_until_connected(60_000)
                client.notify("STARTED", 1)
                {ending}
            """
            app = self.python(script)
            self.hear(self.watcher, "STARTED")
            if "sleep" in ending:
                app.send_signal(signal.SIGINT)
            _, err = app.communicate(timeout=PATIENCE)
            right = {"pass": 0, "raise SystemExit(3)": 3, "1 // 0": 1}.get(ending, -signal.SIGINT)
            self.assertEqual(app.returncode, right, err)

    def test_an_asyncio_loop_iterates_over_messages(self):
        async def listen():
            async with elk.listen(self.community, "listener", ["COUNT"], lossless=True) as bus:
                heard = []
                self.watcher.notify("COUNT", 0)
                async for message in bus:
                    heard.append(message.value())
                    if len(heard) == 500:
                        return heard
                    bus.notify("COUNT", len(heard))

        heard = asyncio.run(asyncio.wait_for(listen(), PATIENCE))
        self.assertEqual(heard, [float(n) for n in range(500)])

    def test_an_asyncio_loop_ends_with_its_client(self):
        async def listen():
            async with elk.listen(self.community, "listener", ["COUNT"]) as bus:
                self.watcher.notify("COUNT", 7)
                heard = []
                async for message in bus:
                    heard.append(message.value())
                    closing = asyncio.get_running_loop().run_in_executor(None, bus.close)
                await closing
                return heard

        self.assertEqual(asyncio.run(asyncio.wait_for(listen(), PATIENCE)), [7.0])

"""MOOS' own client library, core-moos as pymoos' wheels bring it, before elk's port: see docs/moos.md, "Tried with".

    python3.10 -m venv venv && venv/bin/pip install pymoos
    ELK=target/debug/elk venv/bin/python -m unittest discover --start-directory tests/pymoos

pymoos' wheels are for Python 3.6 to 3.10. Without one the tests skip, unless ELK_NO_SKIPS says that pymoos is there.
"""

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

try:
    import pymoos  # noqa: F401, which the clients' processes use
except ImportError as error:
    if {"1", "pymoos"} & set(os.environ.get("ELK_NO_SKIPS", "").replace(",", " ").split()):
        raise
    raise unittest.SkipTest(f"pymoos is missing: {error}")

from client import picture
from port import ELK, PATIENCE, OnAPort

MISSION = (
    '<Scenario><Bus moos="127.0.0.1:{port}"/>'
    '<App name="pHelm" exec="./helm.py" moos="true"><Speed> 2.5 </Speed></App></Scenario>'
)

# As pAntler starts a program: with a file and its name.
HELM = '''
import sys, threading, pymoos
said = dict(line.split("=", 1) for line in open(sys.argv[1]) if "=" in line)
said = {name.strip(): value.strip() for name, value in said.items()}
helm = pymoos.comms()
helm.set_on_connect_callback(lambda: helm.notify("HELM_SPEED", float(said["Speed"])))
helm.run(said["ServerHost"], int(said["ServerPort"]), sys.argv[2])
threading.Event().wait()
'''


def hashed(length):
    return [length, hashlib.sha256(picture(length)).hexdigest()]


class Talking(OnAPort):
    def test_two_clients_hear_numbers_texts_and_bytes_of_each_other_in_order(self):
        b = self.client("b", ["NUMBER", 0], ["TEXT", 0], ["BYTES", 0])
        a = self.client("a")
        self.settle(b)
        before = a.ask("time")
        a.ask("notify", "NUMBER", 2.5)
        a.ask("notify", "TEXT", "wörter, mit Komma")
        a.ask("notify_picture", "BYTES", 1000)
        a.ask("notify", "NUMBER", 3.5, "gps")
        a.ask("notify", "NUMBER", 4.5, "gps", 77.0)
        a.ask("notify", "NUMBER", 5.5, 88.0)
        numbers = b.mail("NUMBER", 4)
        self.assertEqual([one["value"] for one in numbers], [2.5, 3.5, 4.5, 5.5])
        self.assertEqual([one["aux"] for one in numbers], ["", "gps", "gps", ""])
        self.assertEqual([one["time"] for one in numbers[2:]], [77.0, 88.0])
        self.assertNear(numbers[0]["time"], before)
        self.assertEqual(b.values("TEXT"), ["wörter, mit Komma"])
        self.assertEqual(b.values("BYTES"), [hashed(1000)])
        for one in numbers + b.mail("TEXT") + b.mail("BYTES"):
            self.assertEqual((one["source"], one["community"]), ("a", self.community))
        kinds = [b.mail(key)[0]["kind"] for key in ("NUMBER", "TEXT", "BYTES")]
        self.assertEqual(kinds, ["double", "string", "binary"])

    def test_who_registers_late_is_given_the_latest_value_and_who_writes_it_its_own(self):
        a = self.client("a", ["X", 0])
        a.ask("notify", "X", 1.0)
        a.ask("notify", "X", 2.0)
        self.assertEqual(a.values("X", 2), [1.0, 2.0])
        late = self.client("late", ["X", 0])
        self.assertEqual(late.values("X"), [2.0])
        a.ask("notify", "X", 3.0)
        self.assertEqual(late.values("X", 2), [2.0, 3.0])

    def test_an_interval_lets_the_first_and_the_last_through(self):
        a, b = self.client("a", ["X", 0.5], ["Y", 0]), self.client("b")
        self.settle(a)
        for number in range(10):
            b.ask("notify", "X", float(number))
        b.ask("notify", "Y", 1.0)
        a.mail("Y")
        self.assertEqual(a.values("X", lambda mail: mail[-1]["value"] == 9.0), [0.0, 9.0])

    def test_patterns_match_names_and_sources_also_of_what_comes_later(self):
        b, c = self.client("b"), self.client("c")
        b.ask("notify", "NAV_X", 1.0)
        c.ask("notify", "NAV_Y", 2.0)
        self.settle(b, c)
        a = self.client("a", ["NAV_*", "b", 0], ["DB_*", "*", 0], ["END", 0])
        self.settle(a)
        c.ask("notify", "NAV_X", 3.0)
        self.settle(c)
        b.ask("notify", "NAV_Z", 4.0)
        b.ask("notify", "END", 1.0)
        a.mail("END")
        self.assertEqual((a.values("NAV_X"), a.values("NAV_Z")), ([1.0], [4.0]))
        self.assertFalse([one for one in a.news if one.get("mail", {}).get("key") == "NAV_Y"])
        self.assertEqual(a.mail("DB_UPTIME")[0]["source"], f"MOOSDB_{self.community}")

    def test_images_go_whole_and_one_that_is_too_long_is_said(self):
        b, a = self.client("b", ["IMAGE", 0], ["DB_EVENT", 0]), self.client("a")
        self.settle(b)
        lengths = [0, 70_000, 1_000_000, 1 << 20]
        for length in [*lengths, 3 << 20, 5]:
            a.ask("notify_picture", "IMAGE", length)
        self.assertEqual(b.values("IMAGE", 5), [hashed(length) for length in [*lengths, 5]])
        refused = lambda mail: any(one["value"].startswith("refused=a ") and "at most" in one["value"] for one in mail)
        b.mail("DB_EVENT", refused)

    def test_a_queue_takes_its_variables_messages_on_a_thread_of_its_own(self):
        a, b = self.client("a"), self.client("b")
        self.assertTrue(a.ask("queue", "poses", "POSE") and a.ask("has_active_queue", "poses"))
        self.settle(a)
        for number in range(5):
            b.ask("notify", "POSE", float(number))
        poses = lambda news: [one["mail"]["value"] for one in news if one.get("queued") == "poses"]
        a.wait_for(lambda news: len(poses(news)) == 5, "five poses")
        self.assertEqual(poses(a.news), [0.0, 1.0, 2.0, 3.0, 4.0])

    def test_ten_thousand_messages_come_in_order(self):
        b, a = self.client("b", ["N", 0]), self.client("a")
        self.settle(b)
        # core-moos drops half of what waits to be sent once that is more than 2,048 messages.
        for before in range(0, 10_000, 1_000):
            for number in range(before, before + 1_000):
                a.process.stdin.write(json.dumps([-1, "notify", "N", float(number)]) + "\n")
            a.process.stdin.flush()
            b.mail("N", before + 1_000)
        self.assertEqual(b.values("N", 10_000), [float(number) for number in range(10_000)])

    def test_what_carries_another_kind_of_value_is_refused_in_words(self):
        b, a = self.client("b", ["X", 0], ["DB_EVENT", 0]), self.client("a")
        a.ask("notify", "X", 1.0)
        a.ask("notify", "X", "one")
        a.ask("notify", "X", 2.0)
        self.assertEqual(b.values("X", lambda mail: mail[-1]["value"] == 2.0)[-2:], [1.0, 2.0])
        refused = lambda mail: any(one["value"].startswith("refused=a variable=X reason=") for one in mail)
        b.mail("DB_EVENT", refused)


class Coming(OnAPort):
    def test_what_a_client_knows_of_its_connection_is_so(self):
        a = self.client("a", ["X", 0])
        self.assertTrue(a.ask("is_connected") and a.ask("is_running") and a.ask("is_asynchronous"))
        self.assertTrue(a.ask("is_registered_for", "X"))
        self.assertEqual(a.ask("get_community_name"), self.community)
        self.assertEqual(a.ask("get_moos_name"), "a")

    def test_who_closes_has_gone_and_its_name_is_free_at_once(self):
        watcher = self.client("watcher", ["DB_EVENT", 0])
        for round in range(1, 6):
            swapped = self.client("swapped")
            swapped.ask("notify", "ROUND", float(round))
            self.assertTrue(swapped.ask("close", True))
            self.assertFalse(swapped.ask("is_connected"))
        gone = lambda mail: [one["value"] for one in mail].count("disconnected=swapped") == 5
        watcher.mail("DB_EVENT", gone)
        late = self.client("late", ["ROUND", 0])
        self.assertEqual(late.values("ROUND"), [5.0])

    def test_a_name_that_is_taken_is_its_holders(self):
        holder = self.client("nav", ["X", 0])
        for _ in range(2):
            other = self.process("nav")
            self.assertFalse(other.ask("wait_until_connected", 300))
        holder.ask("notify", "X", 1.0)
        self.assertEqual(holder.values("X"), [1.0])

    def test_a_client_that_is_killed_can_be_started_again_at_once(self):
        for round in range(3):
            nav = self.client("nav")
            nav.ask("notify", "ROUND", float(round))
            self.settle(nav)
            nav.process.kill()
        self.client("reader", ["ROUND", 0]).mail("ROUND")

    def test_a_hundred_come_at_once(self):
        watcher = self.client("watcher", ["DB_CLIENTS", 0])
        crowd = self.process("crowd", "--crowd", 100)
        self.assertEqual(crowd.connected(), 100)
        everybody = lambda mail: mail[-1]["value"].count("crowd-") == 100
        watcher.mail("DB_CLIENTS", everybody)

    def test_clients_outlive_their_broker_however_it_ends(self):
        """Regression: of those whose broker was killed half were lost for good."""
        clients = [self.client(f"client-{number}", ["AFTER", 0]) for number in range(4)]
        for times, how in enumerate([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM], 2):
            self.broker.send_signal(how)
            self.broker.wait()
            self.start_broker()
            for client in clients:
                self.assertEqual(client.connected(times), self.community)
            clients[0].ask("notify", "AFTER", float(times))
            for client in clients:
                client.mail("AFTER", lambda mail: mail[-1]["value"] == float(times))


class BesideElk(OnAPort):
    def test_elks_apps_and_pymoos_hear_each_other(self):
        a = self.client("a", ["DEPTH", 0], ["MODE", 0])
        self.assertIn("heard by a", self.elk("poke", "DEPTH", "2.5"))
        self.assertIn("heard by a", self.elk("poke", "MODE", "survey"))
        self.assertTrue(a.mail("DEPTH")[0]["source"].startswith("poke-"))
        self.assertEqual((a.values("DEPTH"), a.values("MODE")), ([2.5], ["survey"]))
        a.ask("notify", "SPEED", 1.25)
        a.ask("notify_picture", "IMAGE", 100)
        self.settle(a)
        listed = {row["name"]: row for row in json.loads(self.elk("list", "--json"))["variables"]}
        self.assertEqual([listed[name]["writer"] for name in ("SPEED", "IMAGE")], ["a", "a"])
        self.assertEqual([listed[name]["type"] for name in ("SPEED", "IMAGE")], ["number", "MOOS binary"])
        self.assertEqual(listed["SPEED"]["value"], 1.25)
        self.assertIn("a client of MOOS'", self.elk("info", "a"))

    def test_a_mission_starts_a_program_that_uses_pymoos(self):
        self.end_broker(self.broker)
        with tempfile.TemporaryDirectory() as folder:
            program, mission = Path(folder) / "helm.py", Path(folder) / "mission.xml"
            program.write_text(f"#!{sys.executable}\n{HELM}")
            program.chmod(0o755)
            mission.write_text(MISSION.format(port=self.port))
            command = [ELK, "launch", str(mission), "--headless", "--community", self.community]
            launcher = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.addCleanup(self.end_broker, launcher)
            reader = self.client("reader", ["HELM_SPEED", 0])
            self.assertEqual(reader.mail("HELM_SPEED")[0]["source"], "pHelm")
            reader.mail("HELM_SPEED", lambda mail: mail[-1]["value"] == 2.5)
            self.assertIn("pHelm", self.elk("apps"))
            launcher.terminate()
            launcher.wait(PATIENCE)


class Warped(OnAPort):
    WARP = 10

    def test_times_and_intervals_are_the_communitys(self):
        a, b = self.client("a", ["X", 5.0], ["DB_TIME", 0]), self.client("b")
        self.settle(a)
        before = b.ask("time")
        for number in range(5):
            b.ask("notify", "X", float(number))
        mail = a.mail("X", lambda mail: mail[-1]["value"] == 4.0)
        self.assertEqual([one["value"] for one in mail], [0.0, 4.0])
        self.assertNear(mail[0]["time"], before)
        self.assertNear(a.mail("DB_TIME")[0]["value"], before)


if __name__ == "__main__":
    unittest.main()

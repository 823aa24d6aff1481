"""A broker with a port for clients of MOOS', real ones in processes of their own, and elk's commands beside them."""

import itertools
import json
import os
import socket
import subprocess
import sys
import threading
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
ELK = os.environ.get("ELK", str(HERE.parents[1] / "target/debug/elk"))
PATIENCE = 60.0
COUNT = itertools.count()
ENDED = {"ended": True}


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Process:
    """A pymoos client's process, and what has happened there."""

    def __init__(self, port, name, *more):
        command = [sys.executable, str(HERE / "client.py"), str(port), name, *map(str, more)]
        self.name, self.news, self.changed, self.orders = name, [], threading.Condition(), itertools.count()
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.listener = threading.Thread(target=self.listen)
        self.listener.start()

    def listen(self):
        for line in self.process.stdout:
            with self.changed:
                self.news.append(json.loads(line))
                self.changed.notify_all()
        with self.changed:
            self.news.append(ENDED)
            self.changed.notify_all()

    def wait_for(self, question, what):
        """Waits until `question(news)` answers something that counts, asked anew at all news, and answers that."""
        with self.changed:
            self.changed.wait_for(lambda: question(self.news) or self.news[-1:] == [ENDED], PATIENCE)
            answer = question(self.news)
            if not answer:
                raise AssertionError(f"{self.name}: {what} has not come in {PATIENCE} s; there came {self.news[-5:]}")
            return answer

    def connected(self, times=1):
        """Waits until it was let in so often; into which community."""
        let_in = lambda news: [one["connected"] for one in news if "connected" in one][times - 1 : times]
        return self.wait_for(let_in, f"connection {times}")[0]

    def ask(self, *order):
        """Gives an order, and waits for the answer."""
        number = next(self.orders)
        self.process.stdin.write(json.dumps([number, *order]) + "\n")
        self.process.stdin.flush()
        answers = lambda news: [one for one in news if one.get("answer") == number]
        return self.wait_for(answers, f"the answer to {order}")[0]["value"]

    def mail(self, key, enough=1):
        """Waits for so many messages of a variable; all that came."""
        of_key = lambda news: [one["mail"] for one in news if "mail" in one and one["mail"]["key"] == key]
        is_enough = enough if callable(enough) else lambda mail: len(mail) >= enough
        return self.wait_for(lambda news: (mail := of_key(news)) and is_enough(mail) and mail, f"mail of {key}")

    def values(self, key, enough=1):
        return [one["value"] for one in self.mail(key, enough)]

    def end(self):
        self.process.kill()
        self.process.wait()
        self.listener.join()
        self.process.stdin.close()
        self.process.stdout.close()


class OnAPort(unittest.TestCase):
    """A test with a broker of its own."""

    WARP = None

    def setUp(self):
        self.community, self.port = f"pymoos-{os.getpid()}-{next(COUNT)}", free_port()
        self.start_broker()

    def start_broker(self):
        command = [ELK, "db", "--community", self.community, "--moos", f"127.0.0.1:{self.port}"]
        command += ["--time-warp", str(self.WARP)] if self.WARP else []
        self.broker = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(self.end_broker, self.broker)

    def end_broker(self, broker):
        if broker.poll() is None:
            broker.terminate()
        broker.wait()

    def process(self, name, *more):
        client = Process(self.port, name, *more)
        self.addCleanup(client.end)
        return client

    def client(self, name, *registrations):
        """A client that was let in, and has registered."""
        client = self.process(name, *([self.WARP] if self.WARP else []))
        self.assertEqual(client.connected(), self.community)
        for registration in registrations:
            self.assertTrue(client.ask("want", *registration))
        return client

    def settle(self, *clients):
        """Waits until what these have said so far was taken in: they hear themselves."""
        for client in clients:
            key = f"SETTLED_{next(COUNT)}"
            client.ask("register", key, 0)
            client.ask("notify", key, 1.0)
            client.mail(key)

    def assertNear(self, time, other):
        """Times of one community, as far as a test may take; centuries lie between those of another warp. A quiet client corrects its
        clock by what it takes the server's for, so that they are not in order."""
        self.assertLess(abs(time - other), PATIENCE * (self.WARP or 1))

    def elk(self, *arguments):
        command = [ELK, *arguments, "--community", self.community]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

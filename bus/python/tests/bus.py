"""A community of a test's own, and programs in it."""

import itertools
import os
import subprocess
import sys
import textwrap
import threading
import unittest
from pathlib import Path

import elk

ELK = os.environ.get("ELK", str(Path(__file__).resolve().parents[3] / "target/debug/elk"))
PATIENCE = 60.0
COUNT = itertools.count()


NEWS = threading.Condition()


def news():
    """Something has happened: who waits looks again."""
    with NEWS:
        NEWS.notify_all()


def eventually(question, what):
    """Waits until `question()` answers something that counts, asked anew at all news, and answers that."""
    with NEWS:
        answer = NEWS.wait_for(question, PATIENCE)
    if not answer:
        raise AssertionError(f"{what} has not come in {PATIENCE} s")
    return answer


class OnABus(unittest.TestCase):
    """A test with a broker of its own."""

    #: What the broker is told besides.
    BROKER = []

    def setUp(self):
        self.community = f"python-{os.getpid()}-{next(COUNT)}"
        self.start_broker()

    def start_broker(self):
        command = [ELK, "db", "--community", self.community, *self.BROKER]
        self.broker = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        self.addCleanup(self.end, self.broker)

    def end(self, process):
        if process.poll() is None:
            process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe:
                pipe.close()

    def client(self, name, variables=()):
        """A client that has joined and registered, and whose mail is news."""
        client = elk.comms()
        client.set_on_mail_callback(news)
        client.set_on_connect_callback(lambda: [client.register(variable) for variable in variables])
        client.run(self.community, name)
        self.addCleanup(client.close)
        self.assertTrue(client.wait_until_connected(PATIENCE * 1000))
        return client

    def hear(self, client, variable, count=1):
        """The next messages of a variable."""
        heard = []

        def enough():
            heard.extend(message for message in client.fetch() if message.key() == variable)
            return len(heard) >= count

        eventually(enough, f"{count} of {variable}")
        return heard[-1] if count == 1 else heard

    def python(self, script, *arguments, **how):
        """A Python process of its own."""
        script = textwrap.dedent(script)
        environment = {**os.environ, "ELK_COMMUNITY": self.community, "ELK_NAME": "app"}
        command = [sys.executable, "-c", script, *arguments]
        process = subprocess.Popen(
            command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **how
        )
        self.addCleanup(self.end, process)
        return process

    def elk(self, *arguments):
        """What a command of elk's says."""
        done = subprocess.run([ELK, *arguments], capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

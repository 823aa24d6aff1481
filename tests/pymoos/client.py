"""A client of MOOS' own: pymoos, which is core-moos, in a process of its own. A client that loses its server closes a descriptor
twice now and then, which in a process of several would be another's.

    client.py PORT NAME [WARP]      takes orders as JSON lines, and says what happens as JSON lines
    client.py PORT NAME --crowd N   connects N clients at once, and says when all of them are

An order is `[ID, METHOD, ARGUMENT…]`, for which `{"answer": ID, "value": …}` comes; `METHOD` is one of pymoos' `comms`, or of
`Client`'s here.
"""

import hashlib
import json
import os
import sys
import threading

import pymoos

# pymoos talks on standard output, and so does the library below it: that is kept apart from what happens.
NEWS = os.fdopen(os.dup(1), "w", buffering=1)
os.dup2(2, 1)
SAYING = threading.Lock()


def say(**what):
    with SAYING:
        NEWS.write(json.dumps(what) + "\n")
        NEWS.flush()


def picture(length):
    """Bytes that are not the same anywhere soon."""
    block = b"".join(hashlib.sha256(number.to_bytes(4, "little")).digest() for number in range(512))
    return (block * (length // len(block) + 1))[:length]


def told(message):
    """A message as it came; of bytes their number and their hash."""
    if message.is_double():
        kind, value = "double", message.double()
    elif message.is_binary():  # MOOS calls it a string as well
        data = message.binary_data()
        kind, value = "binary", [len(data), hashlib.sha256(data).hexdigest()]
    else:
        kind, value = "string", message.string()
    return {
        "key": message.key(),
        "kind": kind,
        "value": value,
        "source": message.source(),
        "aux": message.source_aux(),
        "community": message.community(),
        "time": message.time(),
    }


class Client:
    def __init__(self):
        self.comms = pymoos.comms()
        self.comms.set_quiet(True)
        self.comms.set_on_connect_callback(self.on_connect)
        self.comms.set_on_mail_callback(self.on_mail)
        self.wanted = []

    def on_connect(self):
        for registration in self.wanted:
            self.comms.register(*registration)
        say(connected=self.comms.get_community_name())
        return True

    def on_mail(self):
        for message in self.comms.fetch():
            say(mail=told(message))
        return True

    def want(self, *registration):
        """Registers, now and whenever a server is found."""
        self.wanted.append(registration)
        return self.comms.register(*registration)

    def run(self, port, name):
        return self.comms.run("127.0.0.1", port, name)

    def time(self):
        return pymoos.time()

    def notify_picture(self, key, length):
        return self.comms.notify_binary(key, picture(length))

    def queue(self, queue, key):
        """Has a thread of its own take a variable's messages."""
        if not self.comms.add_active_queue(queue, lambda message: say(queued=queue, mail=told(message)) or True):
            return False
        return self.comms.add_message_route_to_active_queue(queue, key) and self.comms.register(key, 0)

    def obey(self, method, *arguments):
        return getattr(self if hasattr(self, method) else self.comms, method)(*arguments)


def crowd(port, name, count):
    """As many clients, at once."""
    connected, everybody = [], threading.Event()

    def on_connect():
        connected.append(True)
        if len(connected) == count:
            everybody.set()
        return True

    clients = [pymoos.comms() for _ in range(count)]
    for number, client in enumerate(clients):
        client.set_quiet(True)
        client.set_on_connect_callback(on_connect)
        client.run("127.0.0.1", port, f"{name}-{number}")
    everybody.wait()
    say(connected=count)
    sys.stdin.read()


def main(port, name, *more):
    if more[:1] == ("--crowd",):
        crowd(int(port), name, int(more[1]))
    else:
        if more:
            pymoos.set_moos_timewarp(float(more[0]))
        client = Client()
        client.run(int(port), name)
        for line in sys.stdin:
            number, *order = json.loads(line)
            say(answer=number, value=client.obey(*order))
    # Without core-moos' own clearing away, in which a client may wait a second for a server.
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])

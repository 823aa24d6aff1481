"""What a message takes from one client of MOOS' own to another by way of elk, each in a process of its own:

    cargo build --release -p elk
    ELK=target/release/elk venv/bin/python tests/pymoos/bench.py [TURNS]

One way, by CLOCK_MONOTONIC in the payload: 64 B at 1 kHz, 1 MB at 30 Hz. The publisher's thread hands a message to core-moos' writing
thread, and the reader's callback is called on core-moos' reading thread: both are Python's, whose share is in the figures. Beside it in
the same run, in turns: the same by elk between two processes of Python's that write and read their sockets themselves, so that the
difference is core-moos'; and from one thread of Python's to another, which is the interpreter's own share.
"""

import os
import socket
import statistics
import struct
import subprocess
import sys
import threading
import time

import pymoos

from port import ELK, free_port

CASES = {"64 B, 1 kHz": (64, 1e-3, 3000), "1 MB, 30 Hz": (1_000_000, 1 / 30, 150)}
WARM_UP = 20


def now():
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def connected(port, name, on_connect=lambda client: True, on_mail=None):
    client = pymoos.comms()
    client.set_quiet(True)
    client.set_on_connect_callback(lambda: on_connect(client))
    if on_mail:
        client.set_on_mail_callback(lambda: on_mail(client))
    client.run("127.0.0.1", port, name)
    assert client.wait_until_connected(60_000), f"{name} was not let in"
    return client


def paced(period, count, say):
    """Calls `say` with a stamp so often; a stamp is taken when its message is due or later, never before."""
    due = now()
    for number in range(count):
        due += int(period * 1e9)
        time.sleep(max(0.0, (due - now()) * 1e-9))
        say(struct.pack("<qq", now(), number))


def read(port, count):
    """Receives so many, reads every byte, and prints how long they were on their way (us)."""
    taken, everything = [], threading.Event()

    def on_mail(client):
        for message in client.fetch():
            data = message.binary_data()
            if len(data) < 64:
                continue
            sent, _ = struct.unpack_from("<qq", data)
            hash(data)
            taken.append((now() - sent) / 1e3)
        if len(taken) >= count:
            everything.set()
        return True

    reader = connected(port, "reader", lambda client: client.register("STAR", 0), on_mail)
    reader.notify_binary("READY", b"1")
    assert everything.wait(120), f"{len(taken)} of {count} came"
    print(*taken[WARM_UP:], flush=True)
    os._exit(0)


def write(port, length, period, count):
    ready = threading.Event()
    writer = connected(port, "writer", lambda client: client.register("READY", 0), lambda client: ready.set() or True)
    assert ready.wait(60)
    filling = bytes(length - 16)
    paced(period, count, lambda stamp: writer.notify_binary("STAR", stamp + filling))
    time.sleep(1)
    os._exit(0)


def message(kind, data, key=b"", value=b"", number=-1.0, name=b"bare"):
    """One of MOOS' messages, as it lies in a packet."""
    text = lambda of: struct.pack("<i", len(of)) + of
    body = struct.pack("<i", -1) + kind + data + text(name) + text(b"") + text(b"") + text(key)
    body += struct.pack("<ddd", time.time(), number, -1.0) + text(value)
    return struct.pack("<i", len(body) + 4) + body


def packet(said):
    return struct.pack("<iib", len(said) + 9, 1, 0) + said


class Bare:
    """A client that is nothing but a socket."""

    def __init__(self, port, name):
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.say(message(b"i", b"S", b"asynchronous", name, name=b""), b"ELKS CAN'T DANCE 2/8/10".ljust(32, b"\0"))
        self.packet()

    def say(self, said, before=b""):
        self.socket.sendall(before + packet(said))

    def packet(self):
        header = self.socket.recv(4, socket.MSG_WAITALL)
        return self.socket.recv(struct.unpack("<i", header)[0] - 4, socket.MSG_WAITALL)

    def mail(self):
        """The values of the next packet's messages of bytes."""
        bytes_, at = self.packet(), 5
        while at < len(bytes_):
            end = at + struct.unpack_from("<i", bytes_, at)[0]
            texts = at + 10
            for _ in range(4):
                texts += 4 + struct.unpack_from("<i", bytes_, texts)[0]
            if bytes_[at + 9 : at + 10] == b"B":
                yield bytes_[texts + 28 : end]
            at = end


def bare_read(port, count):
    reader, taken = Bare(port, b"reader"), []
    reader.say(message(b"R", b"D", b"STAR", number=0.0))
    reader.say(message(b"N", b"B", b"READY", b"1"))
    alive = time.monotonic()
    while len(taken) < count:
        for data in reader.mail():
            sent, _ = struct.unpack_from("<qq", data)
            hash(data)
            taken.append((now() - sent) / 1e3)
        if time.monotonic() - alive > 1:
            alive = time.monotonic()
            reader.say(message(b"T", b"D", b"_async_timing", number=0.0))
    print(*taken[WARM_UP:], flush=True)


def bare_write(port, length, period, count):
    writer, filling = Bare(port, b"writer"), bytes(length - 16)
    writer.say(message(b"R", b"D", b"READY", number=0.0))
    while not list(writer.mail()):
        pass
    paced(period, count, lambda stamp: writer.say(message(b"N", b"B", b"STAR", stamp + filling)))
    time.sleep(1)


def handed_over(length, period, count):
    """The same message by way of two threads of Python's: what the interpreter takes (us)."""
    import queue

    mail, taken, filling = queue.SimpleQueue(), [], bytes(length - 16)

    def take():
        for _ in range(count):
            data = mail.get()
            sent, _ = struct.unpack_from("<qq", data)
            hash(data)
            taken.append((now() - sent) / 1e3)

    reader = threading.Thread(target=take)
    reader.start()
    paced(period, count, lambda stamp: mail.put(stamp + filling))
    reader.join()
    return taken[WARM_UP:]


def by_elk(prefix, turn, length, period, count):
    port = free_port()
    broker = subprocess.Popen([ELK, "db", "--community", f"bench-{os.getpid()}-{turn}", "--moos", f"127.0.0.1:{port}"])
    try:
        while socket.socket().connect_ex(("127.0.0.1", port)):
            time.sleep(0.01)
        own = lambda *words: subprocess.Popen([sys.executable, __file__, *map(str, words)], stdout=subprocess.PIPE, text=True)
        reader, writer = own(f"{prefix}read", port, count), own(f"{prefix}write", port, length, period, count)
        taken = [float(word) for word in reader.communicate(timeout=180)[0].split()[-(count - WARM_UP) :]]
        writer.kill()
        writer.wait()
        return taken
    finally:
        broker.terminate()
        broker.wait()


def quantiles(taken):
    ordered = sorted(taken)
    return statistics.median(ordered), ordered[int(len(ordered) * 0.99)]


def main(turns):
    for name, (length, period, count) in CASES.items():
        rows = {"pymoos, elk, pymoos": [], "sockets of Python's, elk": [], "two threads of Python's": []}
        for turn in range(turns):
            rows["pymoos, elk, pymoos"].append(quantiles(by_elk("", turn, length, period, count)))
            rows["sockets of Python's, elk"].append(quantiles(by_elk("bare-", turn, length, period, count)))
            rows["two threads of Python's"].append(quantiles(handed_over(length, period, count)))
        for what, found in rows.items():
            (p50, p99), of_turns = map(statistics.median, zip(*found)), [round(p50) for p50, _ in found]
            print(f"{name:12}  {what:24} p50 {p50:8.0f} us   p99 {p99:8.0f} us   p50 of the turns {of_turns}", flush=True)


if __name__ == "__main__":
    role, *words = sys.argv[1:] or ["5"]
    if role in ("read", "bare-read"):
        (read if role == "read" else bare_read)(*map(int, words))
    elif role in ("write", "bare-write"):
        (write if role == "write" else bare_write)(int(words[0]), int(words[1]), float(words[2]), int(words[3]))
    else:
        main(int(role))

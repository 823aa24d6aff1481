"""What Python costs on the bus, beside Rust in the same run, in turns.

    cargo build --release -p elk && cargo build --release -p elk-bus --example round_trip
    python bus/python/benches/bus.py [TURNS]
"""

import os
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
ELK, RUST = ROOT / "target/release/elk", ROOT / "target/release/examples/round_trip"
TRIPS, SCANS, MEGABYTE = 3000, 4000, 4 << 18


def echo(community):
    import elk

    class Echo(elk.App):
        def on_start_up(self):
            self.register("PING")

        def on_new_mail(self, message):
            self.notify("PONG", message.string())

    Echo("echo", community).run()


def read(community, count):
    """As round_trip's `read`, and besides: the seconds of this thread's processor a message."""
    import elk

    class Read(elk.App):
        heard = 0

        def on_start_up(self):
            self.register("NUMBERS", lossless=True)

        def on_new_mail(self, message):
            numbers = message.value()["numbers"]
            assert len(numbers) == MEGABYTE // 4 and numbers[-1] == len(numbers) - 1 and not numbers.flags.owndata
            if self.heard == 0:
                self.began, self.cpu = time.perf_counter(), time.thread_time()
            self.heard += 1
            if self.heard == count:
                took, cpu = time.perf_counter() - self.began, time.thread_time() - self.cpu
                print(f"{(count - 1) * numbers.nbytes / took / 1e9:.3f} {(count - 1) * numbers.nbytes / cpu / 1e9:.3f}")
                self.stop()

    Read("read", community).run()


def start(*command):
    return subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, text=True)


def own(role, community, *words):
    return start(sys.executable, __file__, role, community, *words)


def said(process):
    return [float(word) for word in process.communicate(timeout=120)[0].split()]


def numbers(*command):
    return said(start(*command))


class Watcher:
    """Waits for a broker, and then for clients."""

    def __init__(self, community):
        import elk

        self.names, self.news, self.client = set(), threading.Condition(), elk.comms()
        self.client.set_on_connect_callback(lambda: self.client.register("DB_CLIENTS"))
        self.client.set_on_mail_callback(self.look)
        self.client.run(community, "watcher")
        assert self.client.wait_until_connected(60_000), "there is no broker"

    def look(self):
        with self.news:
            self.names.update(name for said in self.client.fetch() for name in said.string().split(","))
            self.news.notify_all()

    def wait_for(self, name):
        with self.news:
            assert self.news.wait_for(lambda: name in self.names, 60), f"{name} has not come"


def trips(community, watcher, process):
    watcher.wait_for("echo")
    try:
        return numbers(RUST, "ping", community, TRIPS)
    finally:
        process.terminate()
        process.wait()


def scans(community, watcher, process):
    watcher.wait_for("read")
    writer = start(RUST, "scans", community, SCANS)
    try:
        return said(process)
    finally:
        writer.wait()


def main(turns):
    medians = {}
    for turn in range(turns):
        for what, measure, processes in [
            ("round trip", trips, {"Rust": lambda c: start(RUST, "echo", c), "Python": lambda c: own("echo", c)}),
            ("scans", scans, {"Rust": lambda c: start(RUST, "read", c, SCANS), "Python": lambda c: own("read", c, SCANS)}),
        ]:
            for who, process in processes.items():
                community = f"bench-{os.getpid()}-{turn}"
                broker = start(ELK, "db", "--community", community)
                watcher = Watcher(community)
                medians.setdefault((what, who), []).append(measure(community, watcher, process(community)))
                watcher.client.close()
                broker.terminate()
                broker.wait()
    row = lambda *of: [statistics.median(column) for column in zip(*medians[of])]
    rust, python = row("round trip", "Rust"), row("round trip", "Python")
    print(f"round trip, 64 B, 1 kHz, p50 / p99: Rust {rust[0]:.1f} / {rust[1]:.1f} us, Python {python[0]:.1f} / {python[1]:.1f} us")
    print(f"  Python / Rust at p50: {python[0] / rust[0]:.2f}, of the turns " + ", ".join(
        f"{p[0] / r[0]:.2f}" for p, r in zip(medians["round trip", "Python"], medians["round trip", "Rust"])))
    rust, python = row("scans", "Rust"), row("scans", "Python")
    print(f"1 MB taken as an array: Python {python[0]:.1f} GB/s, Rust in place {rust[0]:.1f} GB/s (bound by the writer's copy)")
    print(f"  Python by its own processor's time: {python[1]:.1f} GB/s")


if __name__ == "__main__":
    role, *words = sys.argv[1:] or ["5"]
    if role == "echo":
        echo(*words)
    elif role == "read":
        read(words[0], int(words[1]))
    else:
        main(int(role))

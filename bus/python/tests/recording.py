"""Recordings of typed values whose bytes somebody has changed: `elk replay` says them on a bus as they are."""

import struct
import zlib

MAGIC = b"\x89MCAP0\r\n"
CHUNK, DATA_END, FOOTER = 0x06, 0x0F, 0x02


def records(data):
    """The records of an MCAP file: number, where their content begins, its length."""
    at = len(MAGIC)
    while at + 9 <= len(data) - len(MAGIC):
        number, length = data[at], struct.unpack_from("<Q", data, at + 1)[0]
        yield number, at + 9, length
        at += 9 + length


def without_checksums(data):
    """The same without checksums, which nobody has to have."""
    data = bytearray(data)
    for number, start, length in list(records(data)):
        if number == CHUNK:
            struct.pack_into("<I", data, start + 24, 0)
        elif number == DATA_END:
            struct.pack_into("<I", data, start, 0)
        elif number == FOOTER:
            struct.pack_into("<I", data, start + 16, 0)
    return bytes(data)


def spoilt(value):
    """Values of the same length that are none of the type, or odd ones: at each place numbers that are much, none, or nothing, and
    noise of the same kind each time."""
    odd = [struct.pack("<d", number) for number in (float("nan"), float("inf"), -1e300)]
    odd += [struct.pack("<Q", number) for number in (0, 2**64 - 1, 2**63, 10**6)]
    for at in range(0, len(value) - 7, 4):
        for bad in odd:
            yield value[:at] + bad + value[at + 8 :]
    yield bytes(len(value))
    yield b"\xff" * len(value)
    noise = zlib.crc32(b"noise")
    for _ in range(20):
        junk = bytearray()
        while len(junk) < len(value):
            noise = zlib.crc32(struct.pack("<I", noise))
            junk += struct.pack("<I", noise)
        yield bytes(junk[: len(value)])

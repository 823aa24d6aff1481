// The server's side of WebSocket (RFC 6455), as far as the mock needs it: whole messages, no extensions.

import { createHash } from "node:crypto";

const MAGIC = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
const [CONTINUED, TEXT, BINARY, CLOSE, PING, PONG] = [0, 1, 2, 8, 9, 10];

/** Answers an HTTP upgrade; `onmessage(text)` and `onclose()` are to be set on what it returns. */
export class WebSocketServerSide {
    #rest = Buffer.alloc(0);
    #parts = [];

    constructor(request, socket) {
        this.socket = socket;
        const accept = createHash("sha1")
            .update(request.headers["sec-websocket-key"] + MAGIC)
            .digest("base64");
        socket.write(
            `HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: ${accept}\r\n\r\n`,
        );
        socket.on("data", data => this.#read(data));
        socket.on("close", () => this.onclose?.());
        socket.on("error", () => socket.destroy());
    }

    send(data) {
        if (this.socket.destroyed) return;
        const isText = typeof data === "string";
        this.#write(isText ? TEXT : BINARY, isText ? Buffer.from(data) : data);
    }

    /** Says good-bye, with a reason. */
    close(code, reason) {
        const payload = Buffer.alloc(2 + Buffer.byteLength(reason));
        payload.writeUInt16BE(code);
        payload.write(reason, 2);
        this.#write(CLOSE, payload);
    }

    /** Cuts the connection, without a word. */
    cut() {
        this.socket.destroy();
    }

    #write(opcode, payload) {
        const length = payload.length;
        const head = Buffer.alloc(length < 126 ? 2 : length < 65536 ? 4 : 10);
        head[0] = 0x80 | opcode;
        head[1] = length < 126 ? length : length < 65536 ? 126 : 127;
        if (head.length === 4) head.writeUInt16BE(length, 2);
        if (head.length === 10) head.writeBigUInt64BE(BigInt(length), 2);
        this.socket.write(Buffer.concat([head, payload]));
    }

    #read(data) {
        this.#rest = Buffer.concat([this.#rest, data]);
        for (let frame = this.#next(); frame; frame = this.#next()) this.#take(frame);
    }

    /** The next frame, if the whole of it is there. */
    #next() {
        const rest = this.#rest;
        if (rest.length < 2) return null;
        const short = rest[1] & 127;
        const mask = short < 126 ? 2 : short === 126 ? 4 : 10;
        if (rest.length < mask + 4) return null;
        const length = short < 126 ? short : short === 126 ? rest.readUInt16BE(2) : Number(rest.readBigUInt64BE(2));
        const start = mask + 4;
        if (rest.length < start + length) return null;
        const payload = Buffer.from(rest.subarray(start, start + length));
        for (let i = 0; i < length; i++) payload[i] ^= rest[mask + (i % 4)];
        this.#rest = rest.subarray(start + length);
        return { last: (rest[0] & 0x80) !== 0, opcode: rest[0] & 15, payload };
    }

    #take({ last, opcode, payload }) {
        if (opcode === PING) return this.#write(PONG, payload);
        if (opcode === CLOSE) return this.socket.end();
        if (opcode !== TEXT && opcode !== CONTINUED) return;
        this.#parts.push(payload);
        if (!last) return;
        const text = Buffer.concat(this.#parts).toString();
        this.#parts = [];
        this.onmessage?.(text);
    }
}

// The connection: a WebSocket that delivers checked messages, acknowledges each whole frame, and comes back by itself.

import { check } from "./messages.js";
import { readBinary } from "./binary.js";

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;
/** What a server says whose view ends, as WebSocket has it. */
const AWAY = 1001;
/** The longest message that a server takes (bytes). */
const MOST_SAID = 64 << 10;

export class Link {
    #handlers = new Map();
    #socket = null;
    #wait = FIRST_WAIT_MS;
    #timer = 0;
    #number = 0;

    /** `connecting`, `open`, or `waiting` until the next try. */
    state = "connecting";
    /** When the next try is, by `performance.now()`. */
    nextTry = 0;
    /** Whether the server has said that the view ends. */
    hasEnded = false;

    /** @param {URL} address of the server's `/ws`, with the page's own query. */
    constructor(address) {
        this.address = address;
    }

    /** Calls `handler(message)` for each message of a type; the page's own are `link`, `problem`, `bricks`, `scan`, `drawing` and `surfaces`. */
    on(type, handler) {
        this.#handlers.set(type, [...(this.#handlers.get(type) ?? []), handler]);
    }

    /** Sends, if there is somebody to send to; says whether there was. */
    send(message) {
        if (this.state !== "open") return false;
        this.#socket.send(JSON.stringify(message));
        return true;
    }

    /** Whether a message is not too long for a server. */
    fits(message) {
        return new TextEncoder().encode(JSON.stringify(message)).length <= MOST_SAID;
    }

    /** A number for a question, by which its answer is known again. */
    nextId() {
        return ++this.#number;
    }

    connect() {
        clearTimeout(this.#timer);
        this.#become("connecting");
        const socket = new WebSocket(this.address);
        socket.binaryType = "arraybuffer";
        socket.onopen = () => this.#become("open");
        socket.onmessage = event => this.#receive(event.data);
        socket.onclose = event => this.#lost(event);
        this.#socket = socket;
    }

    /** Tries at once instead of when the wait is over. */
    retry() {
        if (this.state === "waiting") this.connect();
    }

    #lost({ code, reason }) {
        const wait = this.#wait * (0.75 + Math.random() / 2);
        this.#wait = Math.min(2 * this.#wait, LONGEST_WAIT_MS);
        this.nextTry = performance.now() + wait;
        this.reason = reason;
        // Once it has said so, that nobody answers is no news.
        this.hasEnded = code === AWAY || (this.hasEnded && reason === "");
        this.#timer = setTimeout(() => this.connect(), wait);
        this.#become("waiting");
    }

    #become(state) {
        this.state = state;
        this.#deliver("link", { state });
    }

    #receive(data) {
        try {
            if (data instanceof ArrayBuffer) this.#binary(data);
            else this.#text(data);
        } catch (error) {
            this.#deliver("problem", { text: `A message of the server was passed over: ${error.message}` });
        }
    }

    #binary(data) {
        const message = readBinary(data);
        if (message) this.#deliver(message.type, message);
    }

    #text(data) {
        const message = check(JSON.parse(data));
        if (message === null) return;
        if (message.type === "hello") Object.assign(this, { hasEnded: false }).#wait = FIRST_WAIT_MS;
        this.#deliver(message.type, message);
        if (message.type === "frame") this.send({ type: "ack", number: message.number });
    }

    #deliver(type, message) {
        for (const handler of this.#handlers.get(type) ?? []) handler(message);
    }
}

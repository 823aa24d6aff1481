// A server of the page with a made-up mission behind it, by the protocol of apps/view/PROTOCOL.md.
//
//     node tests/view/mock.mjs [--port 8090] [--recorded] [--stress] [--read-only]

import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

import { Run, boxOf, scanMessage, surfacesMessage } from "./building.mjs";
import { WebSocketServerSide } from "./websocket.mjs";

const PAGE = fileURLToPath(new URL("../../apps/view/page/", import.meta.url));
const TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
};
/** Frames that may be on their way to a page. */
const IN_FLIGHT = 3;
const TICK_MS = 100;
/** Scans a second. */
const PACE = 10;

const parameter = (name, kind, fallback, summary, more = {}) => ({
    name,
    kind,
    default: fallback,
    summary,
    unit: null,
    choices: null,
    min: null,
    max: null,
    ...more,
});
const ELEMENTS = [
    {
        element: "Explorer",
        types: [
            {
                name: "Potential",
                summary: "Streamlines of a harmonic field lead to every frontier.",
                params: [
                    parameter("MaxSpeed", "number", "0.5", "How fast the robot goes.", {
                        unit: "m/s",
                        min: 0.05,
                        max: 5,
                    }),
                    parameter("Mid", "point", null, "Middle of the volume to explore.", { unit: "m" }),
                    parameter("MaxVoxels", "integer", "4000000", "The largest field.", { min: 1000, max: 100000000 }),
                    parameter("Isovolumes", "number", "0", "Share of the flow that may be sealed off.", {
                        min: 0,
                        max: 0.5,
                    }),
                    parameter("Policy", "choice", "ScanOnTheWay", "When it scans.", {
                        choices: ["ScanOnTheWay", "ScanAtTarget"],
                    }),
                    parameter("Wide", "flag", "false", "Whether it looks at wide frontiers first."),
                ],
            },
            {
                name: "ClosestFrontier",
                summary: "Goes to the nearest frontier voxel that can be reached.",
                params: [parameter("Clearance", "number", "0.3", "From walls.", { unit: "m", min: 0, max: 2 })],
            },
        ],
    },
    {
        element: "Map",
        types: [
            {
                name: "OctoMap",
                summary: "Log-odds voxels.",
                params: [parameter("Res", "number", "0.1", "Edge of a voxel.", { unit: "m", min: 0.005, max: 10 })],
            },
        ],
    },
];
const APPS = [
    ["launcher", "", "launcher"],
    ["db", "", ""],
    ["sensor", "Sensor", "Simulator"],
    ["filter", "Filter", "Distance"],
    ["map", "Map", "OctoMap"],
    ["explorer", "Explorer", "Potential"],
    ["controller", "Controller", "MOOSSim"],
    ["logger", "Logger", "Mcap"],
];

/** One page that looks on. */
class Viewer {
    scan = -1;
    acked = 0;
    frame = 0;
    watched = new Set();
    layers = new Set(["scan"]);
    log = null;
    logLines = 0;
    fresh = true;

    constructor(mock, socket) {
        Object.assign(this, { mock, socket });
        socket.onmessage = text => this.#take(JSON.parse(text));
        this.send(mock.hello());
        if (mock.summary) this.send({ type: "end", summary: mock.summary });
        for (const message of mock.shown) this.send(message);
    }

    send(message) {
        this.socket.send(message instanceof Uint8Array ? message : JSON.stringify(message));
    }

    #take(message) {
        const { mock } = this;
        mock.received.push(message);
        if (message.type === "ack" && mock.acks) this.acked = message.number;
        if (message.type === "watch") this.watched = new Set(message.keys);
        if (message.type === "show") {
            const asks = message.layers.includes("world") && !this.layers.has("world");
            this.layers = new Set(message.layers);
            if (asks) mock.world.forEach(answer => this.send(answer));
        }
        if (message.type === "logs") Object.assign(this, { log: message.app, logLines: 0 });
        if (message.type === "types") this.send({ type: "types", id: message.id, elements: ELEMENTS });
        if (message.type === "order") mock.order(this, message);
        if (message.type === "press")
            this.send({ type: "answer", id: message.id, ok: true, text: `${message.app} is told of ${message.key}` });
        if (message.type === "poke")
            this.send({ type: "answer", id: message.id, ok: true, text: `${message.key} is ${message.value}` });
        if (message.type === "play")
            Object.assign(mock.timeline, { playing: message.playing, rate: message.rate, looping: message.looping });
        if (message.type === "seek") mock.seek(message.time);
    }

    /** Sends what is new, if not too much is on its way. */
    update() {
        if (this.frame - this.acked >= IN_FLIGHT) return;
        const { mock } = this;
        const { run } = mock;
        const to = mock.scan;
        if (to < this.scan) {
            this.send({ type: "reset" });
            this.scan = -1;
        }
        if (to !== this.scan) this.#move(run, to);
        if (mock.tick % 10 === 0 || this.fresh) this.#tables(to);
        for (const key of this.watched) this.send(mock.value(key));
        if (this.log !== null) this.#lines();
        if (mock.timeline)
            this.send({ type: "timeline", ...mock.timeline, start: 0, end: run.length / PACE, at: to / PACE });
        this.fresh = false;
        this.send({ type: "frame", number: ++this.frame });
    }

    #move(run, to) {
        const pose = run.poses[to];
        this.send(run.bricks(this.scan, to));
        if (this.layers.has("scan")) this.send(scanMessage(run.scans[to]));
        this.send({
            type: "robot",
            position: pose.at,
            quaternion: pose.quaternion,
            camera: run.camera,
            time: to / PACE,
        });
        const from = this.scan + 1;
        this.send({ type: "way", from, points: run.poses.slice(from, to + 1).map(({ at }) => at) });
        const ahead = run.poses.slice(to, to + 25).map(({ at }) => at);
        this.send({ type: "plan", points: ahead, target: ahead.length > 1 ? ahead.at(-1) : null });
        this.send({
            type: "curve",
            name: "coverage",
            from,
            points: run.marks.slice(from, to + 1).map(({ way, known }) => [way, known]),
        });
        this.scan = to;
    }

    #tables(scan) {
        const { mock } = this;
        const { way, known } = mock.run.marks[scan];
        const phase = mock.paused ? "paused" : scan === mock.run.length - 1 ? "complete" : "exploring";
        this.send({
            type: "progress",
            scans: scan + 1,
            way,
            known,
            frontier: 400 + (scan % 50) * 7,
            phase,
            time: scan / PACE,
        });
        this.send({ type: "apps", rows: mock.apps() });
        this.send({ type: "variables", rows: mock.variables(), left_out: 0 });
    }

    #lines() {
        const all = Math.floor(this.mock.tick / 5) + 3;
        const lines = Array.from(
            { length: all - this.logLines },
            (_, i) =>
                `[${((this.logLines + i) / 2).toFixed(1)}] ${this.log}: step ${this.logLines + i}, nothing out of the ordinary`,
        );
        if (lines.length > 0) this.send({ type: "log", app: this.log, from: this.logLines, lines });
        this.logLines = all;
    }
}

export class Mock {
    /** All that pages have sent, in order. */
    received = [];
    /** Drawings and keys, which a page is sent when it comes. */
    shown = [];
    /** What a page is sent that shows the world. */
    world = [{ type: "world", ok: true, text: "" }, surfacesMessage(boxOf([0, 0, 0], [15, 10, 2.7]))];
    viewers = new Set();
    scan = 0;
    tick = 0;
    paused = false;
    /** Why nobody is let in, if so. */
    refusal = null;
    /** Whether acks count; a test that stops them sees a page as a slow one. */
    acks = true;

    constructor(run, { recorded = false, readOnly = false } = {}) {
        Object.assign(this, { run, readOnly });
        this.timeline = recorded ? { playing: true, rate: 1, looping: false } : null;
        this.swapped = new Map();
        this.stopped = new Set();
    }

    /** Listens on loopback; returns the page's address. */
    async listen(port = 0) {
        this.server = createServer((request, response) => this.#file(request, response));
        this.server.on("upgrade", (request, socket) => this.#upgrade(request, socket));
        await new Promise(resolve => this.server.listen(port, "127.0.0.1", resolve));
        this.timer = setInterval(() => this.#step(), TICK_MS);
        this.port = this.server.address().port;
        return `http://127.0.0.1:${this.port}/?token=secret`;
    }

    /** Ends all connections and takes no more. */
    async close() {
        clearInterval(this.timer);
        for (const viewer of this.viewers) viewer.socket.cut();
        this.server.closeAllConnections();
        await new Promise(resolve => this.server.close(resolve));
    }

    hello() {
        const recorded = this.timeline && {
            log: "apartment-20261123-231812",
            start: 0,
            end: this.run.length / PACE,
        };
        return {
            type: "hello",
            version: 1,
            live: this.timeline ? null : { community: "elk" },
            recorded,
            read_only: this.readOnly,
            mission: "Building",
            resolution: this.run.resolution,
        };
    }

    /** Sends a message to all pages. */
    send(message) {
        for (const viewer of this.viewers) viewer.send(message);
    }

    order(viewer, { id, order }) {
        const answer = (ok, text) => viewer.send({ type: "answer", id, ok, text });
        if (order.command === "pause") this.paused = true;
        if (order.command === "resume") this.paused = false;
        if (order.command === "step") this.scan = Math.min(this.scan + 1, this.run.length - 1);
        if (order.command === "stop") this.stopped.add(order.app);
        if (order.command === "start") this.stopped.delete(order.app);
        if (order.command === "swap") {
            answer(null, `${order.app} is being started`);
            if (order.type_name) this.swapped.set(order.app, order.type_name);
        }
        answer(
            true,
            {
                pause: "the robot holds",
                resume: "it goes on",
                step: "one pose",
                stop: "it has stopped",
                start: "it runs",
                swap: "it runs in its place",
            }[order.command],
        );
        this.send({ type: "event", time: this.scan / PACE, text: `${order.command} ${order.app ?? ""}`.trim() });
    }

    seek(time) {
        this.scan = Math.max(0, Math.min(this.run.length - 1, Math.round(time * PACE)));
    }

    apps() {
        return APPS.map(([name, element, type], i) => ({
            name,
            element,
            type: this.swapped.get(name) ?? type,
            pid: this.stopped.has(name) ? null : 4200 + i,
            state: this.stopped.has(name) ? "stopped" : "running",
            state_secs: this.tick / 10,
            cpu_percent_now: 3 + ((i * 37 + this.tick) % 60),
            resident_bytes: 6e6 * (i + 1),
            dropped: name === "logger" ? 12 : 0,
            rejected: 0,
            restarts: name === "filter" ? 1 : 0,
            swaps: this.swapped.has(name) ? 1 : 0,
            last_exit: name === "filter" ? "signal 9" : null,
        }));
    }

    variables() {
        const typed = [
            ["PROGRESS", "Progress", "controller"],
            ["POSE_COMMAND", "PoseCommand", "controller"],
            ["SCAN", "Scan", "sensor"],
            ["SCAN_1", "Scan", "filter"],
            ["MAP_UPDATE", "MapUpdate", "map"],
            ["MAP_KNOWN", "MapStatus", "map"],
            ["PLAN", "Plan", "explorer"],
            ["PLAN_REQUEST", "PlanRequest", "controller"],
            ["BATTERY", "number", "sensor"],
            ["MOTION", "text", "launcher"],
            ["DB_TIME", "number", "db"],
            ["EXPLORER_STATUS", "text", "explorer"],
        ];
        return typed.map(([key, type, writer], i) => ({
            key,
            type,
            writer,
            age: 0.03 * (i + 1) ** 2,
            rate: 10 / (i + 1),
            bytes: 40 * (i + 1) ** 3,
            count: this.tick * (i + 1),
            readers: i % 4,
        }));
    }

    value(key) {
        const base = { type: "value", key, time: this.tick / 10, source: "mock" };
        if (key === "BATTERY") return { ...base, kind: "number", value: 12 + Math.sin(this.tick / 8), text: "12.0" };
        if (key === "PROGRESS")
            return {
                ...base,
                kind: "Progress",
                value: {
                    scans: this.scan,
                    path_length_m: this.run.marks[this.scan].way,
                    finished: false,
                    pose: { position: this.run.poses[this.scan].at },
                },
                text: "a progress",
            };
        return { ...base, kind: "text", value: `value ${this.tick} of ${key}`, text: `value ${this.tick} of ${key}` };
    }

    #step() {
        this.tick += 1;
        const plays = this.timeline ? this.timeline.playing : !this.paused;
        const by = this.timeline ? this.timeline.rate : 1;
        if (plays) this.scan += Math.max(1, Math.round((by * PACE * TICK_MS) / 1000));
        if (this.scan > this.run.length - 1) {
            if (!this.timeline && !this.summary && this.run.length > 1) this.#end();
            this.scan = this.timeline?.looping ? 0 : this.run.length - 1;
        }
        for (const viewer of this.viewers) viewer.update();
    }

    #end() {
        const { way, known } = this.run.marks.at(-1);
        this.summary = {
            mission: "Building",
            complete: true,
            reason: "no frontier that can be reached is left",
            scans: this.run.length,
            path_length_m: way,
            known_voxels: known,
            accuracy: 0.998,
            contacts: 0,
            frontiers_left: { unreachable: 3, invisible: 12 },
            cpu_seconds: { "map insertion": 1.23 },
        };
        this.send({ type: "end", summary: this.summary });
    }

    #upgrade(request, socket) {
        this.lastQuery = new URL(request.url, "http://mock").search;
        const webSocket = new WebSocketServerSide(request, socket);
        if (this.refusal) return webSocket.close(1008, this.refusal);
        const viewer = new Viewer(this, webSocket);
        viewer.socket.onclose = () => this.viewers.delete(viewer);
        this.viewers.add(viewer);
    }

    async #file({ url }, response) {
        const name = normalize(new URL(url, "http://mock").pathname).replace(/\/$/, "/index.html");
        try {
            const content = await readFile(join(PAGE, name));
            response
                .writeHead(200, { "content-type": TYPES[extname(name)] ?? "application/octet-stream" })
                .end(content);
        } catch {
            response.writeHead(404).end("there is no such file");
        }
    }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
    const has = flag => process.argv.includes(flag);
    const port = has("--port") ? Number(process.argv[process.argv.indexOf("--port") + 1]) : 8090;
    const run = has("--stress") ? Run.known(1_000_000) : Run.explored(3, 2);
    const mock = new Mock(run, { recorded: has("--recorded"), readOnly: has("--read-only") });
    console.log(
        `${await mock.listen(port)}  ${run.marks.at(-1).occupied} voxels occupied at the end, ${run.length} scans`,
    );
}

// Chromium without a window, driven by the DevTools protocol over two pipes.

import { spawn } from "node:child_process";
import { mkdtemp, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";

const NAMES = ["chromium", "chromium-browser", "google-chrome"];
const FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
];
const SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const WITHOUT = ["--disable-3d-apis"];

/** Numbers that Chromium wants of keys without a text. */
const CODES = { Tab: 9, Escape: 27, ArrowLeft: 37, ArrowRight: 39 };
/** After this nothing comes any more: a test that waits so long has failed (ms). */
const WATCHDOG_MS = 120_000;

/** Waits until `look()` gives something, and returns it. */
export async function until(look, what) {
    const end = performance.now() + WATCHDOG_MS;
    for (;;) {
        const value = await look();
        if (value) return value;
        if (performance.now() > end) throw new Error(`never: ${what}`);
        await new Promise(resolve => setTimeout(resolve, 30));
    }
}

export class Browser {
    #number = 0;
    #waiting = new Map();
    #rest = "";
    /** Errors that pages have thrown or written. */
    errors = [];

    /** Starts the first browser that there is; null if there is none. `webgl: false` is one that cannot draw in three dimensions. */
    static async start({ webgl = true } = {}) {
        const profile = await mkdtemp(join(tmpdir(), "elk-browser-"));
        const flags = [...FLAGS, ...(webgl ? SOFTWARE : WITHOUT), `--user-data-dir=${profile}`];
        for (const name of NAMES) {
            const child = spawn(name, flags, { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
            const started = await new Promise(resolve => {
                child.once("spawn", () => resolve(true));
                child.once("error", () => resolve(false));
            });
            if (started) return new Browser(child, profile);
        }
        await rm(profile, { recursive: true });
        return null;
    }

    constructor(child, profile) {
        Object.assign(this, { child, profile });
        child.stdio[3].on("error", () => {});
        child.stdio[4].setEncoding("utf8").on("data", data => this.#read(data));
    }

    async close() {
        const ended = new Promise(resolve => this.child.once("exit", resolve));
        this.#send("Browser.close").catch(() => this.child.kill());
        await ended;
        await rm(this.profile, { recursive: true, force: true, maxRetries: 10, retryDelay: 100 });
    }

    /** A new page of an address and a size; `media` as in `{"prefers-color-scheme": "light"}`. */
    async open(url, { width = 1280, height = 800, media = {}, touch = false } = {}) {
        const { targetId } = await this.#send("Target.createTarget", { url: "about:blank" });
        const { sessionId } = await this.#send("Target.attachToTarget", { targetId, flatten: true });
        const page = new Page((method, parameters) => this.#send(method, parameters, sessionId), this, targetId);
        for (const domain of ["Page", "Runtime", "Network"]) await page.send(`${domain}.enable`);
        await page.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: touch });
        if (touch) await page.send("Emulation.setTouchEmulationEnabled", { enabled: true });
        const features = Object.entries(media).map(([name, value]) => ({ name, value }));
        await page.send("Emulation.setEmulatedMedia", { features });
        await page.send("Page.navigate", { url });
        return page;
    }

    #send(method, params = {}, sessionId) {
        const id = ++this.#number;
        this.child.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
        return new Promise((resolve, reject) => this.#waiting.set(id, { method, resolve, reject }));
    }

    #read(data) {
        const parts = (this.#rest + data).split("\0");
        this.#rest = parts.pop();
        for (const part of parts) this.#take(JSON.parse(part));
    }

    #take({ id, result, error, method, params }) {
        if (method === "Runtime.exceptionThrown")
            this.errors.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
        if (method === "Runtime.consoleAPICalled" && params.type === "error")
            this.errors.push(params.args.map(({ value }) => value).join(" "));
        if (method === "Network.requestWillBeSent") (this.requests ??= []).push(params.request.url);
        const waiting = this.#waiting.get(id);
        this.#waiting.delete(id);
        if (error) waiting?.reject(new Error(`${waiting.method}: ${error.message}`));
        else waiting?.resolve(result);
    }
}

class Page {
    constructor(send, browser, targetId) {
        Object.assign(this, { send, browser, targetId });
    }

    close() {
        return this.send("Page.close");
    }

    /** The value of an expression, or of the promise that it is. */
    async eval(expression) {
        const { result, exceptionDetails } = await this.send("Runtime.evaluate", {
            expression,
            awaitPromise: true,
            returnByValue: true,
        });
        if (exceptionDetails)
            throw new Error(`${expression}: ${exceptionDetails.exception?.description ?? exceptionDetails.text}`);
        return result.value;
    }

    /** Waits until an expression is true, and returns its value. */
    until(expression) {
        return until(
            () => this.eval(`(() => { try { return ${expression} } catch { return null } })()`).catch(() => null),
            expression,
        );
    }

    /** Presses a key where the focus is. */
    async press(key, modifiers = 0) {
        const event = { key, modifiers, text: key.length === 1 ? key : undefined, windowsVirtualKeyCode: CODES[key] };
        await this.send("Input.dispatchKeyEvent", { type: "keyDown", ...event });
        await this.send("Input.dispatchKeyEvent", { type: "keyUp", ...event });
    }

    async picture(file) {
        const { data } = await this.send("Page.captureScreenshot", { format: "png" });
        await writeFile(file, Buffer.from(data, "base64"));
    }
}

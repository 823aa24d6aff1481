// What the page weighs and how fast it is, drawn by the processor alone, each beside its baseline of the same run.
//
//     node tests/view/measure.mjs

import { readFileSync, readdirSync } from "node:fs";
import { createServer } from "node:http";
import { gzipSync } from "node:zlib";

import { Browser } from "./browser.mjs";
import { Run } from "./building.mjs";
import { Mock } from "./mock.mjs";
import { readBinary } from "../../apps/view/page/binary.js";
import { faces, freeRows, rowsWithout } from "../../apps/view/page/mesh.js";
import { Voxels } from "../../apps/view/page/voxels.js";

const PAGE = new URL("../../apps/view/page/", import.meta.url);
const ROUNDS = 7;
const MB = 2 ** 20;

const median = numbers => numbers.toSorted((a, b) => a - b)[numbers.length >> 1];
const firstPaint = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime";

function sizes() {
    const files = readdirSync(PAGE, { recursive: true }).filter(name => name.includes("."));
    const contents = files.map(name => readFileSync(new URL(name, PAGE)));
    const sum = numbers => numbers.reduce((sum, number) => sum + number);
    console.log(
        `files: ${files.length}, ${sum(contents.map(({ length }) => length))} bytes, ${sum(contents.map(content => gzipSync(content).length))} compressed one by one`,
    );
}

/** First paint of the page, and of a page that is one word. */
async function paints(browser, url) {
    const plain = createServer((_, response) =>
        response.writeHead(200, { "content-type": "text/html" }).end("<!doctype html><title>plain</title><p>plain"),
    );
    await new Promise(resolve => plain.listen(0, "127.0.0.1", resolve));
    const addresses = [url, `http://127.0.0.1:${plain.address().port}/`];
    const times = [[], []];
    for (let round = 0; round < ROUNDS; round++) {
        for (const [i, address] of addresses.entries()) {
            const page = await browser.open(address);
            times[i].push(await page.until(firstPaint));
            await page.close();
        }
    }
    plain.closeAllConnections();
    plain.close();
    const [ours, theirs] = times.map(median);
    console.log(
        `first paint: ${ours.toFixed(0)} ms at the median of ${ROUNDS} (a page of one word: ${theirs.toFixed(0)} ms)`,
    );
}

/** Resident memory of the browser's processes (MB), by kind. */
function memory(browser) {
    const stat = pid => readFileSync(`/proc/${pid}/stat`, "utf8").replace(/.*\) /s, "").split(" ");
    const all = readdirSync("/proc").filter(name => /^\d+$/.test(name));
    const parent = new Map(
        all.flatMap(pid => {
            try {
                return [[Number(pid), Number(stat(pid)[1])]];
            } catch {
                return [];
            }
        }),
    );
    const ours = pid => pid === browser.child.pid || (pid > 1 && parent.has(pid) && ours(parent.get(pid)));
    return [...parent.keys()].filter(ours).flatMap(pid => {
        try {
            const kind = /--type=([\w-]+)/.exec(readFileSync(`/proc/${pid}/cmdline`, "utf8"))?.[1] ?? "browser";
            const [, rss] = /VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${pid}/status`, "utf8")) ?? [0, 0];
            return [{ kind, rss: rss / 1024 }];
        } catch {
            return [];
        }
    });
}

/** Frames a second while the camera goes round. */
async function rate(page, words, before) {
    await page.eval(before);
    const rate = await page.eval(`(async () => {
        const { stage } = elk, from = stage.frames, start = performance.now();
        while (performance.now() - start < 5000) {
            stage.camera.orbit(0.02, 0);
            await new Promise(requestAnimationFrame);
        }
        return (stage.frames - from) / (performance.now() - start) * 1000;
    })()`);
    console.log(`  ${rate.toFixed(1)} frames a second, ${words}`);
}

/** CPU time (ms) of taking a message of bricks in and meshing all of it, as the page does, in Node. */
function takingAndMeshing(message) {
    const buffer = message.buffer.slice(message.byteOffset, message.byteOffset + message.byteLength);
    const before = process.cpuUsage();
    const voxels = new Voxels();
    voxels.take(readBinary(buffer));
    for (const chunk of voxels.chunks()) {
        faces(voxels, chunk, "occupied", freeRows);
        faces(voxels, chunk, "frontier", rowsWithout("frontier"));
    }
    const { user, system } = process.cpuUsage(before);
    return (user + system) / 1000;
}

async function large(browser, words, run) {
    const mock = new Mock(run);
    const message = run.bricks(-1, 0);
    const idle = Math.max(
        ...memory(browser)
            .filter(({ kind }) => kind === "renderer")
            .map(({ rss }) => rss),
    );
    const page = await browser.open(await mock.listen());
    const whole = await page.until("elk.stage.whenWhole");
    // Reading a pixel waits until all is painted.
    const painted = await page.eval(`(() => {
        const { gl } = elk.stage.scene;
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        return performance.now();
    })()`);
    const [first, rectangles] = await page.eval("[elk.stage.whenFirst, elk.stage.scene.chunks.rectangles]");
    const processes = memory(browser);
    const most = kind => Math.max(...processes.filter(process => process.kind === kind).map(({ rss }) => rss));
    console.log(
        `${words}: ${run.marks[0].occupied} occupied of ${run.marks[0].known} known voxels in ${(message.length / MB).toFixed(1)} MB, ${rectangles} rectangles`,
    );
    console.log(
        `  first frame with voxels ${first.toFixed(0)} ms after the page was asked for, the whole map ${whole.toFixed(0)} ms, painted ${painted.toFixed(0)} ms`,
    );
    console.log(
        `  memory of the page's process ${most("renderer").toFixed(0)} MB (empty: ${idle.toFixed(0)} MB), of the drawing process ${most("gpu-process").toFixed(0)} MB`,
    );
    console.log(
        `  of it taking the bricks in and meshing them, CPU time in Node: ${takingAndMeshing(message).toFixed(0)} ms`,
    );
    await rate(page, "the whole map", "0");
    await rate(page, "from within", "elk.stage.camera.move({ distance: 12 })");
    await rate(page, "in 2-D", "elk.stage.showFlat(true), elk.stage.whole()");
    await page.close();
    await mock.close();
}

sizes();
const browser = await Browser.start();
if (!browser) throw new Error("chromium is missing");
const small = new Mock(Run.known(10_000));
const url = await small.listen();
await paints(browser, url);
await small.close();
await large(browser, "smooth surfaces", Run.known(1_000_000, 0.02));
await large(browser, "rough surfaces", Run.known(1_000_000, 0.25));
await browser.close();

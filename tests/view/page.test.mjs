// The page in a real browser, before the mock server. Needs Node and Chromium; skipped by name where Chromium is missing.
//
//     node --test tests/view/*.test.mjs

import assert from "node:assert/strict";
import { readFile, readdir } from "node:fs/promises";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

import { Browser } from "./browser.mjs";
import { Run, bricksMessage } from "./building.mjs";
import { MIDDLE, browser, click, clickText, drawn, heard, pageTest, run } from "./harness.mjs";
import { Mock } from "./mock.mjs";

const PAGE = fileURLToPath(new URL("../../apps/view/page/", import.meta.url));

const order =
    command =>
    ({ type, order }) =>
        type === "order" && order.command === command;

/** The voxels of a plane, as one sorted text: of the page, and of the run. */
function voxelsOfPage(page, plane) {
    return page.eval(`(() => {
        const all = [];
        for (const chunk of elk.world.voxels.chunks()) for (let i = 0; i < 1024; i++) for (let x = 0; x < 32; x++)
            if (chunk.${plane}[i] >>> x & 1) all.push([32 * chunk.x + x, 32 * chunk.y + (i & 31), 32 * chunk.z + (i >> 5)].join());
        return all.sort().join(" ");
    })()`);
}

function voxelsOfRun(run, is, scan) {
    const all = [];
    const [w, l, h] = run.grid.size;
    for (let z = 0; z < h; z++)
        for (let y = 0; y < l; y++)
            for (let x = 0; x < w; x++) if (is.call(run, x, y, z, scan)) all.push([x, y, z].join());
    return all.sort().join(" ");
}

async function assertSame(page, run, scan) {
    await page.until(`elk.known === ${run.marks[scan].known}`);
    for (const [plane, is] of [
        ["known", run.isKnown],
        ["occupied", run.isOccupied],
        ["frontier", run.isFrontier],
    ]) {
        assert((await voxelsOfPage(page, plane)) === voxelsOfRun(run, is, scan), `${plane} voxels after scan ${scan}`);
    }
}

pageTest("the voxels on the page are those that were sent, as the map grows", {}, async ({ page, mock }) => {
    assert.equal(mock.lastQuery, "?token=secret");
    await assertSame(page, run, MIDDLE);
    for (const scan of [MIDDLE + 1, MIDDLE + 9, run.length - 1]) {
        mock.scan = scan;
        await assertSame(page, run, scan);
    }
    assert.deepEqual(await page.eval("elk.world.robot.position"), run.poses.at(-1).at);
    assert.deepEqual(
        await page.eval("elk.world.way"),
        run.poses.map(({ at }) => at),
    );
});

pageTest("what is known is drawn, what is hidden is not, and a cut shows only what is below", {}, async ({ page }) => {
    await page.until("elk.stage.scene.chunks.waiting === 0");
    const layers = await page.eval("[...elk.world.shown]");
    const hide = (layer, shown = false) => page.eval(`elk.world.show("${layer}", ${shown})`);
    for (const layer of layers) await hide(layer);
    assert.equal(await drawn(page), 0);
    await hide("occupied", true);
    const all = await drawn(page);
    assert(all > 0.1, `occupied voxels cover ${all} of the picture`);
    await page.eval("elk.world.clipAt(1)");
    const below = await drawn(page);
    assert(below > 0.02 && below < all, `${below} of ${all} is below the cut`);
    await hide("occupied", false);
    for (const layer of ["frontier", "robot", "way", "plan", "scan", "grid"]) {
        await hide(layer, true);
        assert((await drawn(page)) > 0, layer);
        await hide(layer);
    }
});

pageTest(
    "every frame is acknowledged, and a page that was busy ends up with the same map",
    {},
    async ({ page, mock }) => {
        await heard(mock, ({ type, number }) => type === "ack" && number === 3);
        const busy = page.eval(
            "(() => { const end = performance.now() + 1500; while (performance.now() < end); return 1 })()",
        );
        mock.paused = false;
        await busy;
        mock.paused = true;
        await assertSame(page, run, mock.scan);
        const acks = mock.received.filter(({ type }) => type === "ack").map(({ number }) => number);
        assert.deepEqual(
            acks,
            acks.map((_, i) => i + 1),
        );
    },
);

pageTest(
    "a server that takes no ack sends no more, and what it then sends is one larger step",
    {},
    async ({ page, mock }) => {
        await heard(mock, ({ type }) => type === "ack");
        mock.acks = false;
        const [viewer] = mock.viewers;
        const sent = viewer.acked + 3;
        await page.until(`elk.occupied === ${run.marks[MIDDLE].occupied}`);
        mock.scan = MIDDLE + 30;
        await heard(mock, ({ type, number }) => type === "ack" && number === sent);
        mock.acks = true;
        viewer.acked = sent;
        await assertSame(page, run, MIDDLE + 30);
    },
);

pageTest("a connection that is lost is said in one line, and comes back by itself", {}, async ({ page, mock, url }) => {
    await click(page, "#tab-variables");
    await clickText(page, "#panel-variables .name", "BATTERY");
    for (const viewer of mock.viewers) viewer.socket.cut();
    await page.until(
        "!document.querySelector('#notice').hidden && /Connection lost: trying again/.test(document.querySelector('#notice').textContent)",
    );
    mock.scan = MIDDLE + 5;
    mock.received.length = 0;
    await page.until("elk.link.state === 'open' && document.querySelector('#notice').hidden");
    await assertSame(page, run, MIDDLE + 5);
    assert.deepEqual((await heard(mock, ({ type }) => type === "watch")).keys, ["BATTERY"]);
    await mock.close();
    await page.until("elk.link.state === 'waiting'");
    assert.equal(await page.eval("elk.known"), run.marks[MIDDLE + 5].known, "the last map stays in sight");
    await mock.listen(Number(new URL(url).port));
    mock.send({ type: "status", connected: false, text: "nobody is there" });
    await click(page, "#notice button");
    await page.until("elk.link.state === 'open'");
    await assertSame(page, run, MIDDLE + 5);
});

pageTest("a community that ends is said, and so is its return", {}, async ({ page, mock }) => {
    mock.send({ type: "status", connected: false, text: "The broker of elk is gone: waiting for it." });
    await page.until("document.querySelector('#notice').textContent.includes('The broker of elk is gone')");
    assert.equal(await page.eval("document.querySelector('#badge').textContent"), "no community");
    mock.send({ type: "status", connected: true, text: "The broker of elk is back." });
    await page.until(
        "document.querySelector('#notice').hidden && document.querySelector('#badge').dataset.state === 'live'",
    );
});

pageTest("who is not let in is told why, and gets in later", {}, async ({ page, mock }) => {
    mock.refusal = "the token is another one";
    for (const viewer of mock.viewers) viewer.socket.cut();
    await page.until(
        "/\\(the token is another one\\): trying again/.test(document.querySelector('#notice').textContent)",
    );
    mock.refusal = null;
    await page.until("document.querySelector('#notice').hidden && elk.link.state === 'open'");
    await assertSame(page, run, MIDDLE);
});

pageTest("messages that are wrong are said and passed over, the next ones taken", {}, async ({ page, mock }) => {
    const brick = bricksMessage(0.1, [
        { x: 900, y: 0, z: 0, planes: [0, 1, 2].map(() => new Uint8Array(64).fill(255)) },
    ]);
    const wrong = [
        "no JSON",
        "[]",
        "7",
        "{}",
        '{"type":"robot"}',
        '{"type":"way","from":100000,"points":[]}',
        '{"type":"frame","number":"1"}',
        '{"type":"variables","rows":[{}]}',
        '{"type":"curve","name":"coverage","from":0,"points":[[0,null]]}',
    ];
    const [viewer] = mock.viewers;
    const cut = [
        brick.subarray(0, 30),
        Buffer.concat([brick, brick]),
        Buffer.alloc(0),
        Buffer.of(2, 0, 0, 0, 9, 0, 0, 0),
    ];
    for (const bytes of [...wrong, ...cut]) viewer.socket.send(bytes);
    for (const unknown of ['{"type":"of a later version"}', Buffer.of(77, 1)]) viewer.socket.send(unknown);
    await page.until(`elk.events.problems === ${wrong.length + cut.length}`);
    await page.until(
        "/passed over: robot.position should be 3 numbers/.test(document.querySelector('#panel-events').textContent)",
    );
    mock.scan = MIDDLE + 3;
    await assertSame(page, run, MIDDLE + 3);
    assert.equal(await page.eval("elk.events.problems"), wrong.length + cut.length);
});

pageTest("orders are sent as what they are, and answered where one sees it", {}, async ({ page, mock }) => {
    await clickText(page, "#bar button", "Pause");
    assert.deepEqual((await heard(mock, order("pause"))).order, { command: "pause" });
    await page.until("/Pause: the robot holds/.test(document.querySelector('#toasts').textContent)");
    await clickText(page, "#bar button", "Step");
    await heard(mock, order("step"));
    await clickText(page, "#bar button", "Resume");
    await heard(mock, order("resume"));
    mock.paused = true;
    await click(page, "#tab-apps");
    await clickText(page, "#panel-apps .name", "explorer");
    await clickText(page, "#panel-apps .actions button", "Stop");
    assert.deepEqual((await heard(mock, order("stop"))).order, { command: "stop", app: "explorer" });
    await clickText(page, "#panel-apps .actions button", "Start");
    assert.deepEqual((await heard(mock, order("start"))).order, { command: "start", app: "explorer" });
});

pageTest("a swap asks for type and parameters, and lets nothing wrong out", {}, async ({ page, mock }) => {
    await click(page, "#tab-apps");
    await clickText(page, "#panel-apps .name", "explorer");
    await clickText(page, "#panel-apps .actions button", "Swap…");
    await page.until("document.querySelector('#form').open");
    const fill = (name, value) =>
        page.eval(`(() => {
        const label = [...document.querySelectorAll("#form label")].find(label => label.firstChild.textContent === "${name}");
        const input = document.getElementById(label.htmlFor);
        input.value = "${value}";
        input.dispatchEvent(new Event("change"));
    })()`);
    await fill("MaxSpeed", "99");
    await clickText(page, "#form button", "Swap");
    assert.match(await page.eval("document.querySelector('#form .error:not([hidden])').textContent"), /at most 5 m\/s/);
    assert(await page.eval("document.querySelector('#form').open"));
    await fill("MaxSpeed", "0.8 m/s");
    await fill("Wide", "true");
    await clickText(page, "#form button", "Swap");
    assert.deepEqual((await heard(mock, order("swap"))).order, {
        command: "swap",
        app: "explorer",
        type_name: null,
        params: [
            ["MaxSpeed", "0.8 m/s"],
            ["Wide", "true"],
        ],
    });
    mock.received.length = 0;
    await clickText(page, "#panel-apps .actions button", "Swap…");
    await page.until("document.querySelector('#form').open");
    await fill("Type", "ClosestFrontier");
    await clickText(page, "#form button", "Swap");
    assert.deepEqual((await heard(mock, order("swap"))).order, {
        command: "swap",
        app: "explorer",
        type_name: "ClosestFrontier",
        params: [],
    });
    await page.until("/Swap explorer: it runs in its place/.test(document.querySelector('#toasts').textContent)");
});

pageTest("who may only read is offered nothing to steer", { readOnly: true }, async ({ page }) => {
    await click(page, "#tab-apps");
    await clickText(page, "#panel-apps .name", "explorer");
    const visible = selector =>
        page.eval(
            `[...document.querySelectorAll(${JSON.stringify(selector)})].filter(at => at.checkVisibility()).map(at => at.textContent)`,
        );
    await page.until("document.querySelector('#panel-apps .actions')");
    assert.deepEqual(await visible("#bar button"), []);
    assert.deepEqual(await visible("#panel-apps .actions button"), ["Log"]);
    await click(page, "#tab-variables");
    assert.deepEqual(await visible("#panel-variables form"), []);
});

pageTest("variables are found, watched, plotted and poked", {}, async ({ page, mock }) => {
    await page.press("/");
    await page.send("Input.insertText", { text: "controller prog" });
    await page.until("document.querySelectorAll('#panel-variables .name').length === 1");
    await clickText(page, "#panel-variables .name", "PROGRESS");
    assert.deepEqual((await heard(mock, ({ type, keys }) => type === "watch" && keys.length > 0)).keys, ["PROGRESS"]);
    await click(page, "#panel-variables button[aria-label='Plot PROGRESS pose.position[0]']");
    await click(page, "#tab-run");
    await page.until(
        "/2\\.55/.test(document.querySelector('figure canvas.low').getAttribute('aria-label')) || /at/.test(document.querySelector('figure canvas.low').getAttribute('aria-label'))",
    );
    await click(page, "#tab-variables");
    assert.equal(await page.eval("document.querySelector('#panel-variables form input').value"), "PROGRESS");
    await page.eval("document.querySelectorAll('#panel-variables form input')[1].value = '12.5'");
    await clickText(page, "#panel-variables form button", "Poke");
    const poke = await heard(mock, ({ type }) => type === "poke");
    assert.deepEqual([poke.key, poke.value], ["PROGRESS", "12.5"]);
    await page.until("/PROGRESS is 12.5/.test(document.querySelector('#toasts').textContent)");
});

pageTest("an app's log is asked for while one reads it, and no longer", {}, async ({ page, mock }) => {
    await click(page, "#tab-logs");
    await heard(mock, ({ type, app }) => type === "logs" && app === "sensor");
    await page.until("/sensor: step 2/.test(document.querySelector('pre.log').textContent)");
    await click(page, "#tab-run");
    await heard(mock, ({ type, app }) => type === "logs" && app === null);
});

pageTest("the end of a mission is shown with its summary", {}, async ({ page, mock }) => {
    mock.send({
        type: "end",
        summary: {
            exploration_report: {
                settings: "a scan every 0.4 m and on arrival; a new plan once the target is resolved; clearance 0.1 m",
                complete: true,
                reason: "all is seen",
                frontiers_left: { unreachable: 0, invisible: 12, too_small: 3 },
                counters: [
                    ["iterations", 575],
                    ["stalls", 0],
                ],
            },
            motion_report: {
                path_length_m: 53.7,
                marks: [
                    { share: 0.95, scans: 98 },
                    { share: 1, scans: 167 },
                ],
                contacts: null,
            },
        },
    });
    mock.send({ type: "event", time: 61, text: "all is seen" });
    await page.until("/1:01\\s*all is seen/.test(document.querySelector('#panel-events').textContent)");
    const lines = await page.until("document.querySelector('.summary').innerText");
    assert.deepEqual(lines.split("\n").filter(Boolean), [
        "THE MISSION IS OVER",
        "exploration report",
        ...["complete", "yes", "reason", "all is seen", "frontiers left", "invisible 12, too small 3"],
        ...["counters", "iterations 575"],
        // What is long comes last.
        "settings",
        "a scan every 0.4 m and on arrival; a new plan once the target is resolved; clearance 0.1 m",
        "motion report",
        ...["path length (m)", "53.7", "marks", "share 0.95, scans 98", "share 1, scans 167"],
    ]);
});

pageTest("a recorded run is sought, forwards and back, and played", { recorded: true }, async ({ page, mock }) => {
    const scrub = "document.querySelector('.timeline input[type=range]')";
    await page.until(`${scrub}.checkVisibility()`);
    const seek = time =>
        page.eval(`(() => { const at = ${scrub}; at.value = ${time}; at.dispatchEvent(new Event("input")) })()`);
    for (const scan of [100, 20, 70]) {
        await seek(scan / 10);
        await heard(mock, ({ type, time }) => type === "seek" && Math.abs(time - scan / 10) < 1e-6);
        await assertSame(page, run, scan);
        assert.equal(await page.eval("elk.world.way.length"), scan + 1);
    }
    await page.eval(`${scrub}.focus()`);
    await page.press("ArrowRight");
    await assertSame(page, run, 80);
    await page.eval("document.activeElement.blur()");
    await page.press(" ");
    assert.equal((await heard(mock, ({ type }) => type === "play")).playing, true);
    await page.until("document.querySelector('.timeline button').textContent === 'Pause'");
    await page.eval("(() => { const at = document.querySelector('.timeline input[type=checkbox]'); at.click() })()");
    await heard(mock, ({ type, looping }) => type === "play" && looping);
});

pageTest("a recorded run that is not whole says so", { recorded: true }, async ({ page, mock }) => {
    mock.send({ type: "damage", text: "the log is not whole: the chunk at byte 7 is cut short" });
    await page.until("document.querySelector('#toasts .bad')?.textContent.includes('the chunk at byte 7')");
    await page.until("document.querySelector('.events').textContent.includes('the chunk at byte 7')");
});

pageTest("all of it works with keys", {}, async ({ page, mock }) => {
    await page.press("?");
    await page.until("document.querySelector('#help').open");
    await page.press("Escape");
    await page.until("!document.querySelector('#help').open");
    await page.press("v");
    assert.equal(await page.eval("elk.stage.isFlat"), true);
    await page.press("v");
    await page.press("4");
    assert.equal(await page.eval("elk.world.shown.has('way')"), false);
    await page.press("6");
    await heard(mock, ({ type, layers }) => type === "show" && !layers.includes("scan"));
    await page.press("[");
    assert(await page.eval("elk.world.clip !== null"));
    await page.press("\\");
    assert.equal(await page.eval("elk.world.clip"), null);
    await page.press("f");
    assert.deepEqual(await page.eval("elk.stage.camera.target"), run.poses[MIDDLE].at);
    await page.press("n");
    await heard(mock, order("step"));
    await page.press(" ");
    await heard(mock, ({ type, order }) => type === "order" && ["pause", "resume"].includes(order.command));
    await page.eval("document.querySelector('#scene').focus()");
    const before = await page.eval("elk.stage.camera.yaw");
    await page.press("ArrowLeft");
    assert.notEqual(await page.eval("elk.stage.camera.yaw"), before);
    // Everything that takes the focus has a name.
    const nameless =
        await page.eval(`[...document.querySelectorAll("button, input, select, canvas[tabindex], [role=tabpanel]")].filter(at =>
        !(at.getAttribute("aria-label") || at.getAttribute("aria-labelledby") || at.textContent.trim() || at.labels?.length)).map(at => at.outerHTML)`);
    assert.deepEqual(nameless, []);
    await page.eval("document.querySelector('#tab-run').focus()");
    await page.press("ArrowRight");
    assert.equal(
        await page.eval("document.activeElement.id + ' ' + document.querySelector('#panel-apps').hidden"),
        "tab-apps false",
    );
});

for (const [width, height] of [
    [360, 740],
    [740, 360],
    [760, 740],
    [1280, 740],
]) {
    pageTest(
        `nothing is cut off at ${width} × ${height}`,
        { page: { width, height, touch: Math.min(width, height) === 360 } },
        async ({ page }) => {
            for (const tab of ["run", "apps", "variables", "logs", "events"]) {
                await click(page, `#tab-${tab}`);
                if (tab === "apps") await clickText(page, "#panel-apps .name", "controller");
                const wide =
                    await page.eval(`[document.scrollingElement, ...document.querySelectorAll("main, header, [role=tabpanel]:not([hidden]), #bar")]
                .filter(at => at.scrollWidth > at.clientWidth + 1).map(at => at.id || at.tagName)`);
                assert.deepEqual(wide, [], tab);
            }
            const outside =
                await page.eval(`[...document.querySelectorAll("#stage button, #stage .card")].filter(at => at.checkVisibility()).map(at => [at.id || at.textContent, at.getBoundingClientRect()])
            .filter(([, box]) => box.left < 0 || box.right > innerWidth || box.top < 0 || box.bottom > innerHeight).map(([name]) => name)`);
            assert.deepEqual(outside, []);
        },
    );
}

pageTest(
    "fingers turn, move and pinch the map",
    { page: { width: 360, height: 740, touch: true } },
    async ({ page }) => {
        const touch = (type, ...points) =>
            page.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
        const camera = () =>
            page.eval("(({ yaw, distance, target }) => ({ yaw, distance, target }))(elk.stage.camera)");
        const first = await camera();
        await touch("touchStart", [150, 250]);
        await touch("touchMove", [190, 250]);
        await touch("touchEnd");
        const turned = await camera();
        assert.notEqual(turned.yaw, first.yaw);
        assert.equal(turned.distance, first.distance);
        await touch("touchStart", [120, 250], [180, 250]);
        await touch("touchMove", [100, 250], [220, 250]);
        await touch("touchEnd");
        const pinched = await camera();
        assert(pinched.distance < 0.8 * turned.distance, `${pinched.distance} of ${turned.distance}`);
        assert.equal(pinched.yaw, turned.yaw);
    },
);

test("a browser without WebGL 2 gets the map from above", async t => {
    if (!browser) return t.skip("chromium is missing");
    const plain = await Browser.start({ webgl: false });
    const mock = new Mock(run);
    mock.scan = MIDDLE;
    mock.paused = true;
    try {
        const page = await plain.open(await mock.listen());
        await page.until("elk.occupied > 0 && elk.stage.frames > 1");
        assert.equal(await page.eval("elk.stage.scene"), null);
        await page.until("/this browser has no WebGL 2/.test(document.querySelector('#panel-events').textContent)");
        assert(
            await page.eval("document.querySelector('#view-3d').disabled && !document.querySelector('#flat').hidden"),
        );
        const colours = await page.eval(`(() => {
            elk.stage.flat.draw(elk.stage.colours);
            const { canvas, context } = elk.stage.flat;
            return new Set(new Uint32Array(context.getImageData(0, 0, canvas.width, canvas.height).data.buffer)).size;
        })()`);
        assert(colours > 10, `${colours} colours`);
        await assertSame(page, run, MIDDLE);
        assert.deepEqual(plain.errors, []);
    } finally {
        await plain.close();
        await mock.close();
    }
});

pageTest("a card that loses what it held is given it again", {}, async ({ page }) => {
    await page.until("elk.stage.scene.chunks.waiting === 0");
    const rectangles = await page.eval("elk.stage.scene.chunks.rectangles");
    assert(rectangles > 1000);
    await page.eval("(window.card = elk.stage.scene.gl.getExtension('WEBGL_lose_context')).loseContext()");
    await page.until("elk.stage.scene.gl.isContextLost()");
    await page.eval("card.restoreContext()");
    await page.until(`!elk.stage.scene.gl.isContextLost() && elk.stage.scene.chunks.rectangles === ${rectangles}`);
    assert.equal(await page.eval("elk.stage.scene.gl.getError()"), 0);
});

test("nothing outside is asked for, and all files are small", async t => {
    const names = await readdir(PAGE, { recursive: true, withFileTypes: true });
    const files = names.filter(file => file.isFile()).map(file => `${file.parentPath ?? file.path}/${file.name}`);
    const sizes = await Promise.all(files.map(async file => gzipSync(await readFile(file)).length));
    const bytes = sizes.reduce((sum, size) => sum + size);
    t.diagnostic(`${files.length} files, ${bytes} bytes compressed`);
    assert(bytes < 80_000, `${bytes} bytes`);
    if (!browser) return t.skip("chromium is missing");
    const outside = browser.requests.filter(url => new URL(url).hostname !== "127.0.0.1" && !url.startsWith("data:"));
    assert.deepEqual(outside, []);
});

pageTest("a view that ends says so, and what it showed stays", {}, async ({ page, mock }) => {
    const before = await page.until("elk.known");
    for (const { socket } of mock.viewers) {
        socket.close(1001, "the view has ended");
        socket.socket.end();
    }
    mock.refusal = "nobody is let in";
    await page.until("/The view has ended, and what it showed last stays/.test(document.querySelector('#notice').innerText)");
    assert.ok((await page.eval("elk.known")) >= before);
    mock.refusal = null;
    await page.eval("document.querySelector('#notice button').click()");
    await page.until("elk.link.state === 'open' && document.querySelector('#notice').hidden");
});

pageTest("what is too long to be said is not, and that is said", {}, async ({ page, mock }) => {
    await click(page, "#tab-variables");
    await page.eval(
        "(([key, value]) => { key.value = 'NOTE'; value.value = 'x'.repeat(70_000) })(document.querySelectorAll('#panel-variables form input'))",
    );
    await clickText(page, "#panel-variables form button", "Poke");
    await page.until("/Poke NOTE: that is longer than a page may say/.test(document.querySelector('#toasts').innerText)");
    assert.ok(!mock.received.some(({ type }) => type === "poke"));
    assert.equal(await page.eval("elk.link.state"), "open");
});

// The true world as a ghost, on the page in a real browser.
//
//     node --test tests/view/*.test.mjs

import assert from "node:assert/strict";
import { test } from "node:test";

import { readBinary } from "../../apps/view/page/binary.js";
import { below, edgesOf, sectionOf } from "../../apps/view/page/ghost.js";
import { boxOf, surfacesMessage } from "./building.mjs";
import { PLAN, drawn, heard, pageTest } from "./harness.mjs";

const asked = mock => mock.received.filter(({ type, layers }) => type === "show" && layers.includes("world")).length;
const read = bytes => readBinary(Uint8Array.from(bytes).buffer);
const length = segments => segments.reduce((sum, [from, to]) => sum + Math.hypot(...from.map((x, i) => x - to[i])), 0);

/** Hides all but the world, and looks at the middle of the building from above. */
async function lookAtWorld(page) {
    await page.until("!elk.stage.scene || elk.stage.scene.chunks.waiting === 0");
    await page.eval(`(() => {
        for (const layer of [...elk.world.shown]) elk.world.show(layer, false);
        elk.stage.camera.move({ target: [7, 5, 1], distance: 30, pitch: 0.9, follows: false });
    })()`);
}

/** Pixels of the 2-D picture that have the ghost's colour. */
const drawnFlat = page =>
    page.eval(`(() => {
        const { data } = ${PLAN};
        const ghost = elk.stage.colours.ghost.map(part => Math.round(255 * part));
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if (ghost.every((part, c) => Math.abs(part - data[i + c]) < 25)) count++;
        return count;
    })()`);

pageTest("the world is asked for when it is shown, drawn as far as the cut, and forgotten", {}, async ({ page, mock }) => {
    await lookAtWorld(page);
    assert.equal(asked(mock), 0);
    assert.equal(await drawn(page), 0);
    await page.press("0");
    await page.until("elk.world.surfaces?.triangles.length === 30");
    assert.equal(asked(mock), 1);
    const all = await drawn(page);
    assert(all > 0.05, `it covers ${all} of the picture`);
    assert.equal(await page.eval("elk.stage.scene.gl.getError()"), 0);
    await page.eval("elk.world.clipAt(1)");
    const cut = await drawn(page);
    assert(cut > 0.02 && cut < all, `${cut} of ${all} is below the cut`);
    await page.eval("elk.world.clipAt(-1)");
    assert.equal(await drawn(page), 0);
    await page.eval("elk.world.clipAt(1)");
    await page.press("v");
    await page.until("elk.stage.isFlat && elk.stage.flat.canvas.width > 100");
    const section = await drawnFlat(page);
    assert(section > 500, `its section in the plan: ${section} pixels`);
    await page.press("0");
    assert.equal(await page.eval("elk.world.surfaces"), null);
    assert.equal(await drawnFlat(page), 0);
    await page.press("v");
    assert.equal(await drawn(page), 0);
    await page.press("0");
    await page.until("elk.world.surfaces !== null");
    // Another place of a recording has the same world; another server may have another one.
    mock.send({ type: "reset" });
    await page.until("elk.known === 0");
    assert(await page.eval("elk.world.surfaces !== null"));
    for (const { socket } of mock.viewers) socket.cut();
    const before = asked(mock);
    await heard(mock, () => asked(mock) > before);
    await page.until("elk.link.state === 'open' && elk.world.surfaces !== null");
});

pageTest("why there is no world, and that it is simplified, is said", {}, async ({ page, mock }) => {
    mock.world = [{ type: "world", ok: false, text: "there is no file hall.obj" }];
    await page.press("0");
    await page.until("document.querySelector('#toasts').textContent.includes('there is no file hall.obj')");
    assert.equal(await page.eval("elk.world.surfaces"), null);
    await page.press("0");
    const said = { type: "world", ok: true, text: "the world is simplified" };
    mock.world = [said, surfacesMessage(boxOf([0, 0, 0], [1, 1, 1]))];
    await page.press("0");
    await page.until("document.querySelector('#toasts').textContent.includes('the world is simplified')");
    await page.until("elk.world.surfaces !== null");
});

pageTest("a world is drawn where nothing else is known of a mission", { page: { width: 390, height: 780, touch: true } }, async ({ page }) => {
    await lookAtWorld(page);
    await page.eval("(document.querySelector('#layers').open = true)");
    await page.eval("[...document.querySelectorAll('#layers label')].find(at => at.textContent === 'True world').click()");
    await page.until("elk.world.surfaces !== null");
    assert((await drawn(page)) > 0.01);
});

test("surfaces have edges where they turn and end, and sections", () => {
    const box = read(surfacesMessage(boxOf([0, 0, 0], [3, 2, 1])));
    const edges = edgesOf(box);
    assert.equal(edges.length, 12, "a box has twelve edges, with or without a lid");
    assert.equal(length(edges), 4 * (3 + 2 + 1));
    assert.equal(length(below(edges, 0.25)), 2 * (3 + 2) + 4 * 0.25);
    assert.deepEqual(below(edges, -1), []);
    for (const height of [null, 0.5, 0.999]) assert(Math.abs(length(sectionOf(box, height)) - 10) < 1e-6, `${height}`);
    assert.deepEqual(sectionOf(box, 7), []);
});

test("surfaces that are cut, overlong, or none, are no message", () => {
    const whole = surfacesMessage(boxOf([0, 0, 0], [1, 1, 1]));
    assert.equal(read(whole).corners.length, 24);
    for (let length = 1; length < whole.length; length++) assert.throws(() => read(whole.subarray(0, length)));
    assert.throws(() => read(Buffer.concat([whole, Buffer.alloc(12)])));
    const beyond = Buffer.from(whole);
    beyond.writeUInt32LE(8, whole.length - 4);
    assert.throws(() => read(beyond), /a corner beyond 8/);
});

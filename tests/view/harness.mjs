// What tests of the page in a real browser share: a mock mission that stands still, and a page that looks at it.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { Browser, until } from "./browser.mjs";
import { Run } from "./building.mjs";
import { Mock } from "./mock.mjs";

const NO_SKIPS = (process.env.ELK_NO_SKIPS ?? "").split(/[\s,]+/);
/** Where the mission stands when a test begins: a scan in the middle. */
export const MIDDLE = 60;

export const run = Run.explored(2, 2);
/** The browser of all tests of a file; null: there is none. */
export let browser = null;

before(async () => {
    browser = await Browser.start();
    if (!browser && NO_SKIPS.some(need => ["1", "chromium"].includes(need))) throw new Error("chromium is missing");
});
after(() => browser?.close());

/** A test with a mock mission that stands still, and a page that looks at it. */
export function pageTest(name, options, body) {
    test(name, async t => {
        if (!browser) return t.skip("chromium is missing");
        const mock = new Mock(options.run ?? run, options);
        mock.scan = Math.min(MIDDLE, mock.run.length - 1);
        mock.paused = true;
        if (mock.timeline) mock.timeline.playing = false;
        const url = await mock.listen();
        const { errors } = browser;
        errors.length = 0;
        const page = await browser.open(url, options.page);
        try {
            await page.until("elk.stage.whenFirst");
            await body({ page, mock, url });
            assert.deepEqual(errors, [], "errors on the page");
        } finally {
            await page.close();
            await mock.close();
        }
    });
}

/** Waits for the mock to have heard what `matches`. */
export function heard(mock, matches) {
    return until(() => mock.received.find(matches), `a message as in ${matches}`);
}

export const click = (page, selector) =>
    page.until(`(() => { const at = document.querySelector(${JSON.stringify(selector)}); at.click(); return true })()`);
export const clickText = (page, within, text) =>
    page.until(`(() => {
    [...document.querySelectorAll(${JSON.stringify(within)})].find(at => at.textContent === ${JSON.stringify(text)}).click(); return true })()`);

/** The 3-D picture, on the page: its `data`, four bytes a pixel, `width` and `height`. Drawn and read in one go: a canvas forgets what it showed once it has been shown. */
export const SCENE = `(() => {
    const { scene, colours } = elk.stage, { gl } = scene;
    scene.draw(colours, 1, 0);
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const data = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    return { data, width, height };
})()`;

/** The 2-D picture, on the page, in the same shape. */
export const PLAN = `(() => {
    const { flat, colours } = elk.stage;
    flat.draw(colours);
    return flat.context.getImageData(0, 0, flat.canvas.width, flat.canvas.height);
})()`;

/** The share of the 3-D picture that is not ground. */
export const drawn = page =>
    page.eval(`(() => {
        const { data } = ${SCENE};
        const ground = elk.stage.colours.ground.map(part => Math.round(255 * part));
        let other = 0;
        for (let i = 0; i < data.length; i += 4) if (ground.some((part, c) => Math.abs(part - data[i + c]) > 2)) other++;
        return other / data.length * 4;
    })()`);

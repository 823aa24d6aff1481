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
